"""Compilers: which one is used, what it is, and how it is called."""

import contextlib
import functools
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from springline.codegen.kernel.toolchain.errors import ToolchainError, cache_root

Family = Literal["gcc", "clang", "zig"]

_STDERR_LINES = 12
_NO_COMPILER = (
    "no C compiler found: install one from your system (Debian, Ubuntu: apt-get install gcc libc6-dev; "
    "Fedora: dnf install gcc; macOS: xcode-select --install) or run: pip install 'springline[compiler]'"
)


@dataclass(frozen=True)
class Compiler:
    """A C compiler that has been seen to preprocess ``#include <math.h>``.

    argv     how it is called; the first entry is an absolute path
    family   whose command line and diagnostics it follows
    version  as the compiler names itself, for example ``12.2.0``
    target   machine triple, for example ``x86_64-linux-gnu``
    """

    argv: tuple[str, ...]
    family: Family
    version: str
    target: str


def find_compiler() -> Compiler:
    """The compiler to use: $CC (arguments allowed), else the first that works of cc, gcc, clang, ziglang.

    Raises ToolchainError if $CC is set but does not work, or if there is none at all.
    """
    return _find_compiler(os.environ.get("CC", "").strip(), os.environ.get("PATH", os.defpath))


@functools.cache
def _find_compiler(cc: str, path: str) -> Compiler:
    # `path` is a cache key only: after a change of $PATH the search starts again.
    if cc:
        try:
            words = shlex.split(cc)
        except ValueError as error:  # a quotation mark that is not closed
            raise ToolchainError(
                f"the environment variable CC is {cc!r}, which is no command line ({error}): correct or unset it"
            ) from error
        compiler = probe_compiler(words)
        if compiler is None:
            raise ToolchainError(
                f"the environment variable CC is {cc!r}, which is no working C compiler: correct or unset it"
            )
        return compiler
    candidates = [["cc"], ["gcc"], ["clang"]]
    if importlib.util.find_spec("ziglang") is not None:
        candidates.append([sys.executable, "-m", "ziglang", "cc"])
    for argv in candidates:
        compiler = probe_compiler(argv)
        if compiler is not None:
            return compiler
    raise ToolchainError(_NO_COMPILER)


def probe_compiler(argv: Sequence[str]) -> Compiler | None:
    """The compiler called by `argv`; None where there is none or it does not find the C library's headers."""
    program = shutil.which(argv[0]) if argv else None
    if program is None:
        return None
    call = (os.path.abspath(program), *argv[1:])
    try:
        macros = _preprocess(call, ())
        target = run_compiler([*call, "-dumpmachine"]).stdout.strip()
    except ToolchainError:
        return None
    if _is_zig(call):
        family: Family = "zig"
    else:
        family = "clang" if "__clang__" in macros else "gcc"
    return Compiler(call, family, macros.get("__VERSION__", "unknown").strip('" '), target)


def _is_zig(argv: Sequence[str]) -> bool:
    return "ziglang" in argv or Path(argv[0]).name.startswith("zig")


def predefined_macros(compiler: Compiler, flags: Sequence[str] = ()) -> Mapping[str, str]:
    """Every macro that `compiler` defines under `flags`, ``<math.h>`` and so the C library's included.

    Raises ToolchainError if the compiler refuses the flags.
    """
    return _cached_macros(compiler, tuple(flags))


@functools.cache
def _cached_macros(compiler: Compiler, flags: tuple[str, ...]) -> Mapping[str, str]:
    return _preprocess(compiler.argv, flags)


def _preprocess(argv: Sequence[str], flags: Sequence[str]) -> Mapping[str, str]:
    done = run_compiler([*argv, *flags, "-dM", "-E", "-x", "c", "-"], stdin="#include <math.h>\n")
    definitions = (line.split(maxsplit=2) for line in done.stdout.splitlines() if line.startswith("#define "))
    return {words[1]: words[2] if len(words) == 3 else "" for words in definitions}


@functools.cache
def native_flags(compiler: Compiler) -> tuple[str, ...]:
    """The flags that let `compiler` use all of this machine's CPU; none where it knows no such flag."""
    for flag in ("-march=native", "-mcpu=native"):
        with contextlib.suppress(ToolchainError):  # refused: the other spelling, or the baseline
            predefined_macros(compiler, (flag,))
            return (flag,)
    return ()


def native_vector_width(compiler: Compiler | None = None) -> int:
    """How many doubles a vector register of this machine holds: 8 (AVX-512F), 4 (AVX) or 2."""
    compiler = compiler or find_compiler()
    macros = predefined_macros(compiler, native_flags(compiler))
    if "__AVX512F__" in macros:
        return 8
    return 4 if "__AVX__" in macros else 2


# What the psABI of x86-64 asks of its levels, as macros; each level has what stands below it.
_LEVELS = {
    "x86-64-v4": ("AVX512F", "AVX512BW", "AVX512CD", "AVX512DQ", "AVX512VL"),
    "x86-64-v3": ("AVX", "AVX2", "BMI", "BMI2", "F16C", "FMA", "LZCNT", "MOVBE"),
    "x86-64-v2": ("POPCNT", "SSE3", "SSSE3", "SSE4_1", "SSE4_2"),
    "x86-64": ("x86_64",),
}


def native_instruction_set(compiler: Compiler | None = None) -> str:
    """What the compiler may use of this CPU: "x86-64" to "x86-64-v4", "neon", or the target's architecture."""
    compiler = compiler or find_compiler()
    macros = predefined_macros(compiler, native_flags(compiler))
    needed: set[str] = set()
    found = "neon" if "__ARM_NEON" in macros else compiler.target.partition("-")[0]
    for level, features in reversed(_LEVELS.items()):
        needed |= {f"__{name}__" for name in features}
        if needed <= macros.keys():
            found = level
    return found


def run_compiler(argv: Sequence[str], *, cwd: Path | None = None, stdin: str = "") -> subprocess.CompletedProcess[str]:
    """Run a compiler. Raises ToolchainError with the command and the first lines of its messages."""
    environment = dict(os.environ, LC_ALL="C")
    if _is_zig(argv):
        environment.setdefault("ZIG_GLOBAL_CACHE_DIR", str(cache_root() / "zig"))
    try:
        done = subprocess.run(
            argv,
            check=False,
            cwd=cwd,
            input=stdin,
            env=environment,
            capture_output=True,
            text=True,
            errors="replace",
        )
    except OSError as error:
        raise ToolchainError(f"cannot run {shlex.join(argv)}: {error}") from error
    if done.returncode != 0:
        lines = (done.stderr.strip() or "(it printed no message)").splitlines()
        if len(lines) > _STDERR_LINES:
            lines[_STDERR_LINES:] = [f"... and {len(lines) - _STDERR_LINES} more lines"]
        raise ToolchainError("\n  ".join(["the compiler failed:", shlex.join(argv), *lines]))
    return done
