"""The state of the toolchain, for `springline doctor`."""

import shlex
from typing import NamedTuple

from springline.codegen.kernel.toolchain.cache import build_library, load
from springline.codegen.kernel.toolchain.compiler import (
    find_compiler,
    native_flags,
    native_instruction_set,
    native_vector_width,
)
from springline.codegen.kernel.toolchain.errors import ToolchainError, cache_root


class Check(NamedTuple):
    """One row of ``springline doctor``."""

    name: str
    value: str
    ok: bool


def checks() -> list[Check]:
    """The state of the toolchain: compiler, vector width, cache, and whether a library builds and loads."""
    try:
        cache = Check("cache", str(cache_root()), True)
    except ToolchainError as error:
        cache = Check("cache", str(error), False)
    try:
        compiler = find_compiler()
    except ToolchainError as error:
        return [Check("C compiler", str(error), False), cache]
    rows = [
        Check("C compiler", shlex.join(compiler.argv), True),
        Check("compiler version", f"{compiler.family} {compiler.version}", True),
        Check("target", compiler.target, True),
        Check("native flags", shlex.join(native_flags(compiler)) or "(none)", True),
        Check("instruction set", native_instruction_set(compiler), True),
        Check("vector width", f"{native_vector_width(compiler)} doubles", True),
        cache,
    ]
    if not cache.ok:
        return rows
    source = "int springline_probe(int x);\nint springline_probe(int x) { return x + 1; }\n"
    try:
        library = load(build_library({"probe.c": source}, main="probe.c", compiler=compiler))
        works = library.springline_probe(41) == 42
        rows.append(Check("build and load", "works" if works else "the library gave a wrong sum", works))
    except ToolchainError as error:
        rows.append(Check("build and load", str(error), False))
    return rows
