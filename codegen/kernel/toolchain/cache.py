"""From C sources to a loaded shared library: built once, kept by content.

The cache key holds everything that decides the machine code: sources, flags, and every macro the compiler
predefines under those flags. The macros name compiler version, target, C library and, with ``-march=native``,
each CPU feature, so a cache on a shared home never hands an AVX-512 library to a machine without AVX-512.
"""

import contextlib
import ctypes
import errno
import fcntl
import hashlib
import json
import os
import re
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from springline.codegen.kernel.toolchain.compiler import Compiler, find_compiler, predefined_macros, run_compiler
from springline.codegen.kernel.toolchain.errors import ANOTHER_FOLDER, ToolchainError, cache_root

BASE_FLAGS = ("-fPIC", "-shared", "-ffp-contract=off", "-fno-math-errno", "-Wall", "-Wextra", "-Werror")
"""Flags of every build. No contraction, or bits depend on the machine; errno would make sqrt a call."""

_LIBRARY = "library.so"
_CHECKSUM = "library.sha256"
_KEY = re.compile("[0-9a-f]{64}")


def build_library(
    sources: Mapping[str, str | bytes],
    *,
    main: str,
    flags: Sequence[str] = (),
    compiler: Compiler | None = None,
) -> Path:
    """The shared library that `main` compiles to, built on first need and then taken from the cache.

    sources   file name (relative, ``/`` allowed) -> content; `main` may include all others by these names
    main      the one file that is compiled
    flags     added after BASE_FLAGS, and so winning over them; -std=c99 and -O2 where they name no other.
              ``-l`` flags go behind the source, as linkers want them.

    Warnings are errors. The same input gives the same bytes wherever it is built: names are relative, and
    the folder it was built in is not recorded. Any number of threads and processes may ask at once.

    What is in the cache is code that will run here: a folder that others own or may write to is not trusted, and
    a library comes into it only after another process has loaded it.

    Raises ToolchainError with the command and the compiler's first lines if it fails, or with the remedy where the
    cache cannot be used; ValueError if a file name leaves the folder or `main` is not among the sources.
    """
    compiler = compiler or find_compiler()
    content = _checked_sources(sources, main)
    command = _command(compiler, main, flags)
    root = cache_root()
    entry = root / _cache_key(compiler, content, command)
    library = entry / _LIBRARY
    try:
        _expect_trusted(root, entry)
        if _intact(entry) and _loads(library):
            return library
        for folder in (root, entry):
            folder.mkdir(mode=0o755, parents=True, exist_ok=True)  # whatever the umask allows others
        with _locked(entry / "lock") as exclusive:
            if exclusive:  # whatever lies here is of a build that was killed
                for leftover in entry.glob("build-*"):
                    shutil.rmtree(leftover, ignore_errors=True)
            if not (_intact(entry) and _loads(library)):
                _build(entry, content, command, compiler)
    except OSError as error:
        remedy = ANOTHER_FOLDER
        if error.errno in (errno.EISDIR, errno.ENOTDIR, errno.ELOOP):
            remedy = f"remove what stands in its place, rm -r {shlex.quote(str(entry))}, or {ANOTHER_FOLDER}"
        raise ToolchainError(f"cannot use the cache folder {root} ({error}): {remedy}") from error
    return library


def load(library: Path) -> ctypes.CDLL:
    """The library, loaded; every call into it releases the GIL. Raises ToolchainError if it cannot be."""
    try:
        return ctypes.CDLL(os.fspath(library))
    except OSError as error:
        raise ToolchainError(f"cannot load the compiled library: {error}") from error


class Cached(NamedTuple):
    """Compiled libraries: how many, and how many bytes; `busy` of them are being built by a process at this moment."""

    libraries: int
    bytes: int
    busy: int = 0


def cached() -> Cached:
    """What the cache holds. Raises ToolchainError where there is no folder for it, OSError if it cannot be read."""
    sizes = [_size(entry) for entry in _entries()]
    return Cached(sum(size > 0 for size in sizes), sum(sizes))


def clear_cache() -> Cached:
    """Remove all libraries; what was removed.

    One that a process builds at this moment stays. Lock files stay, too: whoever waits for one must find that others
    wait for the same. What a running process has loaded goes on working. Raises as `cached` does.
    """
    libraries = size = busy = 0
    for entry in _entries():
        with _locked(entry / "lock", wait=False) as mine:
            if mine is None:
                busy += 1
                continue
            freed = _size(entry)
            for leftover in entry.glob("build-*"):
                shutil.rmtree(leftover, ignore_errors=True)
            for name in (_LIBRARY, _CHECKSUM):
                (entry / name).unlink(missing_ok=True)
            libraries, size = libraries + (freed > 0), size + freed
    return Cached(libraries, size, busy)


def _entries() -> list[Path]:
    """The folders of libraries; whatever else somebody has put beside them is not ours."""
    root = cache_root()
    if not root.is_dir():
        return []
    return sorted(place for place in root.iterdir() if _KEY.fullmatch(place.name) and _is_folder(place))


def _is_folder(place: Path) -> bool:
    return place.is_dir() and not place.is_symlink()


def _size(entry: Path) -> int:
    """Bytes of an entry's library; 0 if it has none."""
    try:
        return (entry / _LIBRARY).stat().st_size
    except FileNotFoundError:
        return 0


def _expect_trusted(root: Path, entry: Path) -> None:
    """Raise ToolchainError if anybody but this user and root may put a library where the cache would find it."""
    me = os.geteuid()
    for place in (root, entry, entry / _LIBRARY):
        try:
            found = place.stat()
        except FileNotFoundError:
            return
        if place != entry / _LIBRARY and not stat.S_ISDIR(found.st_mode):
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(place))
        if found.st_uid not in (me, 0):
            raise ToolchainError(
                f"the cache would run the code of another user: {place} belongs to user {found.st_uid}, and you are "
                f"user {me}; {ANOTHER_FOLDER}"
            )
        if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            raise ToolchainError(
                f"the cache would run what others may have written: {place} has mode "
                f"{stat.S_IMODE(found.st_mode):04o}; take their right away, chmod -R go-w {shlex.quote(str(root))}, "
                f"or {ANOTHER_FOLDER}"
            )


def _loads(library: Path) -> bool:
    """Whether a library with a right checksum can be loaded; this process needs it loaded anyway."""
    try:
        load(library)
    except ToolchainError:
        return False
    return True


def _checked_sources(sources: Mapping[str, str | bytes], main: str) -> dict[str, bytes]:
    for name in sources:
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts or not path.name:
            raise ValueError(f"source name {name!r} must be relative and stay inside the build folder")
    if main not in sources:
        raise ValueError(f"main {main!r} is not among the sources: {', '.join(sorted(sources))}")
    return {name: text.encode() if isinstance(text, str) else text for name, text in sorted(sources.items())}


def _command(compiler: Compiler, main: str, flags: Sequence[str]) -> list[str]:
    """The whole compile command, relative to the build folder."""
    libraries = [flag for flag in flags if flag.startswith("-l")]
    others = [flag for flag in flags if not flag.startswith("-l")]
    defaults = []
    if not any(flag.startswith("-std=") for flag in others):
        defaults.append("-std=c99")
    if not any(flag.startswith("-O") for flag in others):
        defaults.append("-O2")
    if compiler.family == "zig":  # it turns the undefined-behaviour sanitizer on by itself
        defaults.append("-fno-sanitize=undefined")
    if sys.platform.startswith("linux"):  # a missing symbol fails here, not when the library is loaded
        defaults.append("-Wl,-z,defs")
    return [*compiler.argv, *BASE_FLAGS, *defaults, *others, "-I.", main, "-o", _LIBRARY, *libraries]


def _cache_key(compiler: Compiler, content: Mapping[str, bytes], command: Sequence[str]) -> str:
    # The preprocessor is asked with what steers the generated code only: for a linker's flag it has no use,
    # and clang says so, which -Werror would turn into a failure.
    flags = command[len(compiler.argv) :]
    steering = [flag for flag in flags if flag.startswith(("-f", "-m", "-O", "-std=", "-D", "-U"))]
    macros = predefined_macros(compiler, steering)
    identity = {
        "arguments": command[1:],  # the compiler counts by what it is, not by where it lies
        "family": compiler.family,
        "target": compiler.target,
        "macros": macros,
        "sources": {name: hashlib.sha256(text).hexdigest() for name, text in content.items()},
    }
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def _intact(entry: Path) -> bool:
    """Whether the entry's library is there and has the checksum that was written with it."""
    try:
        if not all(stat.S_ISREG((entry / name).stat().st_mode) for name in (_LIBRARY, _CHECKSUM)):
            return False  # to read a pipe would be to wait for its writer
        return (entry / _CHECKSUM).read_text(encoding="ascii", errors="replace") == _checksum(entry, entry / _LIBRARY)
    except FileNotFoundError:
        return False


def _checksum(entry: Path, library: Path) -> str:
    """Of a library and of the entry that it belongs to: nothing else fits, not even another library with its own."""
    return hashlib.sha256(entry.name.encode() + library.read_bytes()).hexdigest()


@contextlib.contextmanager
def _locked(path: Path, *, wait: bool = True) -> Iterator[bool | None]:
    """Hold the lock on `path`; yields False where the file system has no locks, None if it is held and we do not wait.

    The lock saves double work and lets us clear up after a killed build. It is not what keeps the cache
    sound: renames and checksums do, so a file system without locks (some cluster homes) will do.
    """
    with path.open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield None
        except OSError as error:
            if error.errno not in (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP):
                raise
            yield False
        else:
            yield True


def _build(entry: Path, content: Mapping[str, bytes], command: Sequence[str], compiler: Compiler) -> None:
    with tempfile.TemporaryDirectory(prefix="build-", dir=entry) as folder:
        work = Path(folder)
        for name, text in content.items():
            (work / name).parent.mkdir(parents=True, exist_ok=True)
            (work / name).write_bytes(text)
        run_compiler([*command, f"-ffile-prefix-map={work}=."], cwd=work)
        library = work / _LIBRARY
        _expect_loadable(library, compiler)
        checksum = work / _CHECKSUM
        checksum.write_text(_checksum(entry, library), encoding="ascii")
        for file in (library, checksum):  # a reader in between sees a mismatch and comes to the lock
            file.chmod(stat.S_IMODE(file.stat().st_mode) & ~(stat.S_IWGRP | stat.S_IWOTH))
            with file.open("rb+") as stream:
                os.fsync(stream.fileno())
            os.replace(file, entry / file.name)


def _expect_loadable(library: Path, compiler: Compiler) -> None:
    """Raise ToolchainError, with the remedy, for a library that does not load.

    It is loaded by another process first: what a broken compiler writes may crash the one that loads it.
    """
    program = "import ctypes, sys; ctypes.CDLL(sys.argv[1])"
    if not library.is_file():
        said = "it wrote no file"
    else:
        argv = [sys.executable, "-I", "-S", "-c", program, str(library)]
        done = subprocess.run(argv, check=False, capture_output=True, text=True, errors="replace")
        if done.returncode == 0:
            return
        last = done.stderr.strip().splitlines()[-1:] or [f"loading it ends with code {done.returncode}"]
        said = last[0].removeprefix("OSError: ").replace(str(library), library.name)
        ours, its = _machine(Path(sys.executable)), _machine(library)
        if ours and its and ours != its:
            raise ToolchainError(
                f"{shlex.join(compiler.argv)} makes code for another machine than this one (its target is "
                f"{compiler.target}): set CC to a compiler for this machine ({said})"
            )
        if os.statvfs(library).f_flag & getattr(os, "ST_NOEXEC", 0):
            raise ToolchainError(
                f"no library can be loaded from the cache folder {cache_root()}, for its file system is mounted "
                f"noexec: set SPRINGLINE_CACHE to a folder elsewhere ({said})"
            )
    raise ToolchainError(
        f"{shlex.join(compiler.argv)} reported success, but what it wrote is no library for this machine ({said}): "
        "repair it, or set CC to another compiler"
    )


def _machine(image: Path) -> bytes:
    """Word size, byte order and processor that an ELF file is for; b"" for any other file."""
    with image.open("rb") as stream:
        header = stream.read(20)
    return header[4:6] + header[18:20] if len(header) == 20 and header.startswith(b"\x7fELF") else b""
