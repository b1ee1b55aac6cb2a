"""Classes of a user's own files: "my_arm.py:MyArm" in a scenario names one.

The file, and the modules beside it that it imports, are read before anything of them runs. What was read is what runs,
and its hash is the class's identity: in the structure, so in every kernel's and every dataset's. Modules beside the
file come before installed ones of the same name, as for a script, but for the standard library's and springline itself;
they are private to the file, so that two users' helper.py do not meet.
"""

from __future__ import annotations

import ast
import builtins
import os
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from importlib import import_module
from importlib.abc import InspectLoader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path, PurePosixPath
from threading import RLock
from types import CodeType, ModuleType
from typing import TypeVar

from springline.codegen.files import canonical_json
from springline.model.registry import Registry
from springline.runner.files import InputError, Problem, unknown
from springline.runner.scenario.locate import canonical_path, file_bytes, reason, relative_path

T = TypeVar("T")

_REFERENCE = re.compile(r"(?P<path>.+\.py):(?P<name>[^\W\d]\w*)")
_PACKAGE = "springline_user_"
_FOREIGN = frozenset({*sys.stdlib_module_names, "springline"})
_LONGEST_LINE = 100
_REFUSED: ContextVar[bool] = ContextVar("refused", default=False)


@contextmanager
def without_code() -> Iterator[None]:
    """Within, and in no other thread, a scenario that names a user's file is refused: for scenarios of strangers."""
    before = _REFUSED.set(True)
    try:
        yield
    finally:
        _REFUSED.reset(before)


@dataclass(frozen=True)
class UserClass:
    """A class of a user's file, as the file was read.

    path   of the file, canonical
    name   of the class
    files  content of the file ("" is its name here) and of the modules beside it, by path from its folder, sorted
    """

    path: str
    name: str
    files: tuple[tuple[str, bytes], ...]

    @cached_property
    def hash(self) -> str:
        """SHA-256 of all files."""
        return sha256(canonical_json([[name, sha256(content).hexdigest()] for name, content in self.files])).hexdigest()

    @property
    def key(self) -> str:
        """What the class is registered as: the same wherever the files lie, another for another content."""
        return f"{self.name}@{self.hash}"

    @property
    def reference(self) -> str:
        """How a scenario names it, with the canonical path."""
        return f"{self.path}:{self.name}"

    def reference_from(self, folder: Path) -> str:
        """How a scenario in `folder` names it."""
        return f"{relative_path(self.path, folder)}:{self.name}"

    def __str__(self) -> str:
        return f"{os.path.basename(self.path)}:{self.name}"


def canonical_reference(text: str, folder: Path, where: str, key: str) -> str:
    """A reference with the path as it means the same from every folder.

    folder      what a relative path counts from
    where, key  what the reference stands in, for messages
    Raises InputError for what is no reference.
    """
    found = _REFERENCE.fullmatch(text)
    if not found:
        expected = 'expected a file and the name of a class in it, as in "my_arm.py:MyArm"'
        raise InputError(Problem(where, key, expected, repr(text)))
    return f"{canonical_path(found['path'], folder, where, key)}:{found['name']}"


def read_class(reference: str, where: str, key: str) -> UserClass:
    """Read the file of a canonical reference, and what it imports from beside it; nothing of it runs.

    where, key  what the reference stands in, for messages
    Raises InputError if a file cannot be read or is no Python, and where users' files are refused.
    """
    found = _REFERENCE.fullmatch(reference)
    assert found, reference
    if _REFUSED.get():
        raise InputError(Problem(where, key, "names a file to run, and --no-code refuses that", reference))
    path = Path(found["path"])
    files: dict[str, bytes] = {}
    pending = [""]
    while pending:
        name = pending.pop()
        if name in files:
            continue
        file = path.parent / name if name else path
        files[name] = _content(file, where, key)
        pending += _beside(path.parent, name, _parsed(files[name], file, where, key))
    return UserClass(found["path"], found["name"], tuple(sorted(files.items())))


def _content(file: Path, where: str, key: str) -> bytes:
    try:
        return file_bytes(file)
    except FileNotFoundError as error:
        there = tuple(sorted(item.name for item in file.parent.glob("*.py")))
        raise InputError(Problem(where, key, f"there is no file {file}", "", file.name, there)) from error
    except (OSError, ValueError) as error:
        raise InputError(Problem(where, key, f"{file} cannot be read ({reason(error)})")) from error


def _parsed(content: bytes, file: Path, where: str, key: str) -> ast.Module:
    try:
        return ast.parse(content, str(file))
    except SyntaxError as error:
        line = f", line {error.lineno}" if error.lineno else ""
        raise InputError(Problem(where, key, f"{file.name}{line}: {error.msg}")) from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise InputError(Problem(where, key, f"{file.name}: is no Python ({error or 'nested too deeply'})")) from error


def _beside(folder: Path, name: str, tree: ast.Module) -> Iterator[str]:
    """Paths from the folder of the modules that a module in it imports, at its beginning or later."""
    package = PurePosixPath(name).parts[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            wanted = [(*alias.name.split("."),) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level] if node.level else ()
            stem = (*above, *_parts(node.module))
            if node.level > len(package) + 1:
                continue  # beyond the folder: Python says so when it runs
            wanted = [stem, *((*stem, alias.name) for alias in node.names)]
        else:
            continue
        relative = isinstance(node, ast.ImportFrom) and node.level > 0
        for parts in wanted:
            if parts and (relative or parts[0] not in _FOREIGN):
                for end in range(1, len(parts) + 1):
                    yield from _files_of(folder, parts[:end])


def _parts(module: str | None) -> tuple[str, ...]:
    return tuple(module.split(".")) if module else ()


def _files_of(folder: Path, parts: Sequence[str]) -> Iterator[str]:
    """The file of a module, if it is beside: a package's first, as Python has it."""
    stem = "/".join(parts)
    for name in (f"{stem}/__init__.py", f"{stem}.py"):
        if (folder / name).is_file():
            yield name
            return


# What runs

_LOADING = RLock()
_code: dict[str, UserClass] = {}


class _Modules(MetaPathFinder, InspectLoader):
    """Imports modules of users' files from what was read of them."""

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """The spec of a module, if it is one of ours."""
        package, *rest = fullname.split(".")
        if package not in _code or (rest and not self._is_there(fullname)):
            return None
        spec = ModuleSpec(fullname, self, origin=self._origin(fullname), is_package=self.is_package(fullname))
        spec.has_location = self._name(fullname) is not None
        return spec

    def is_package(self, fullname: str) -> bool:
        """Whether there are modules inside it; the file itself stands for the package of those beside it."""
        _, *rest = fullname.split(".")
        return not rest or any(name.startswith("/".join(rest) + "/") for name, _ in _code_of(fullname).files)

    def _is_there(self, fullname: str) -> bool:
        return self._name(fullname) is not None or self.is_package(fullname)

    def _name(self, fullname: str) -> str | None:
        """Which file a module is; None for a folder without __init__.py."""
        _, *rest = fullname.split(".")
        stem = "/".join(rest)
        names = {name for name, _ in _code_of(fullname).files}
        wanted = ("",) if not rest else (f"{stem}/__init__.py", f"{stem}.py")
        return next((name for name in wanted if name in names), None)

    def _origin(self, fullname: str) -> str:
        name = self._name(fullname)
        path = Path(_code_of(fullname).path)
        return str(path.parent / name if name else path)

    def get_source(self, fullname: str) -> str:
        """Its text, which tracebacks quote."""
        name = self._name(fullname)
        if name is None:
            return ""
        return dict(_code_of(fullname).files)[name].decode("utf-8", errors="replace")

    def get_code(self, fullname: str) -> CodeType:
        """What runs."""
        name = self._name(fullname)
        content = b"" if name is None else dict(_code_of(fullname).files)[name]
        code: CodeType = compile(content, self._origin(fullname), "exec", dont_inherit=True)
        return code

    def exec_module(self, module: ModuleType) -> None:
        """Run a module; its imports find what is beside the file first."""
        package = module.__name__.partition(".")[0]

        def importing(
            name: str,
            globals: Mapping[str, object] | None = None,  # noqa: A002 - the names that Python calls it with
            locals: Mapping[str, object] | None = None,  # noqa: A002 - likewise
            fromlist: Sequence[str] | None = (),
            level: int = 0,
        ) -> ModuleType:
            top = name.partition(".")[0]
            own = f"{package}.{top}"
            if level or top in _FOREIGN or not self._is_there(own):
                return builtins.__import__(name, globals, locals, fromlist or (), level)
            whole = builtins.__import__(f"{package}.{name}", globals, locals, fromlist or (), 0)
            return whole if fromlist else import_module(own)

        vars(module)["__builtins__"] = {**vars(builtins), "__import__": importing}
        super().exec_module(module)


def _code_of(fullname: str) -> UserClass:
    return _code[fullname.partition(".")[0]]


_MODULES = _Modules()
sys.meta_path.append(_MODULES)


def load_class(user: UserClass, registry: Registry[T], where: str, key: str) -> T:
    """An object of the class, from now on in `registry` as `user.key`; made once in a process.

    where, key  what the reference stands in, for messages
    Raises InputError for a file that does not run, and a class that is not there, of another kind, or not complete.
    """
    with _LOADING:
        if user.key in registry:
            return registry[user.key]
        package = f"{_PACKAGE}{user.hash}"
        _code[package] = user
        with told({user: key}, where):
            try:
                module = import_module(package)
            except BaseException:
                for name in [name for name in sys.modules if name.partition(".")[0] == package]:
                    del sys.modules[name]
                raise
        found = getattr(module, user.name, None)
        kinds = [
            name
            for name, value in vars(module).items()
            if isinstance(value, type) and issubclass(value, registry.base) and value.__module__.startswith(package)
        ]
        if found is None:
            raise InputError(unknown(where, key, f"class in {Path(user.path).name}", user.name, kinds))
        if not isinstance(found, type) or not issubclass(found, registry.base):
            expected = f"{user}: expected a subclass of springline.model.{registry.base.__name__}"
            raise InputError(Problem(where, key, expected, type(found).__name__, user.name, tuple(kinds)))
        with told({user: key}, where):
            made: T = _made(found)
            registry.bring(user.key, made)
        return made


def _made(found: Callable[[], T]) -> T:
    """An object of a class. Raises ValueError for one that cannot be made of nothing, or lacks a method."""
    try:
        return found()
    except TypeError as error:
        raise ValueError(str(error)) from error


@contextmanager
def told(users: Mapping[UserClass, str], where: str) -> Iterator[None]:
    """Within, whatever users' classes raise becomes an InputError that names file, class and lines.

    users  the classes that may run, each with the key that names it
    """
    try:
        yield
    except (InputError, KeyboardInterrupt):
        raise
    except BaseException as error:  # a user's file may raise what it likes
        user = _blamed(error, users)
        if not (_lines(error, user) or isinstance(error, ValueError | RuntimeError)):
            raise  # no line of a user's, and nothing that we or CasADi say of what he gave: a fault of our own
        raise InputError(Problem(where, users[user], f"{user}: {_message(error)}{_lines(error, user)}")) from error


def _blamed(error: BaseException, users: Mapping[UserClass, str]) -> UserClass:
    """Whose lines an error came from, or else whose kind it begins with: "law my_law: rate: ..."."""
    kinds = {
        "mechanism.name": "mechanism",
        "control.law": "law",
        "control.controller": "controller",
        "control.observer": "observer",
        "base_motion.kind": "base motion",
    }
    lines = [user for user in users if _lines(error, user)]
    named = [user for user, key in users.items() if str(error).startswith(f"{kinds[key]} ")]
    return [*lines, *named, *users][0]


def _message(error: BaseException) -> str:
    """What went wrong, without the places in CasADi's sources that its messages begin with."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    told = [line for line in lines if not re.search(r"\.[ch]pp:\d+", line)]
    told = told or [re.sub(r"^.*\.[ch]pp:\d+:\s*", "", line) for line in lines]
    kind = type(error).__name__
    if isinstance(error, ValueError):
        return " ".join(told) or kind
    if isinstance(error, NotImplementedError):
        told = told[:1]  # CasADi goes on with every form that its function has
    return f"{kind}: {' '.join(told)}" if told else kind


def _lines(error: BaseException, user: UserClass) -> str:
    """Where in the user's files, outermost first; the last line is quoted."""
    folder = Path(user.path).parent
    own = {str(folder / name if name else user.path): name or os.path.basename(user.path) for name, _ in user.files}
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename in own]
    if not frames:
        return ""
    places = "; ".join(f"{own[frame.filename]}, line {frame.lineno}, in {frame.name}" for frame in frames)
    line = (frames[-1].line or "").strip()[:_LONGEST_LINE]
    return f" ({places}{': ' if line else ''}{line})"
