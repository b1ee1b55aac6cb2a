"""Prefixes of an export: what would take the place of something else is refused, everything else is not."""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from springline.codegen.export import LONGEST, LONGEST_LINKED, bind, check_files, check_linked
from springline.codegen.export.c import TypedInterface, text_files
from springline.codegen.export.names import check_prefix
from springline.runner.scenario import load_scenario


def accepted(prefix: str) -> bool:
    try:
        check_prefix(prefix)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize(
    "prefix",
    ["arm", "Crane2", "springline", "my_arm", "controller", "plant", "loop", "floats", "stdio_arm", "mathematics",
     "slow", "time_varying", "sea_state", "femur", "semi", "x", "fmu_test_loop_fmi2", "a" * LONGEST],
)  # fmt: skip
def test_ordinary_names_are_fine(prefix: str) -> None:
    check_prefix(prefix)


@pytest.mark.parametrize(
    ("prefix", "why"),
    [
        ("2fast", "no C identifier"), ("a-b", "no C identifier"), ("", "no C identifier"), ("été", "no C identifier"),
        ("arm\n", "no C identifier"), ("_arm", "no C identifier"),
        ("a" * 64, "63 at most: by so many C99"), ("my__arm", "two _"), ("arm_", "two _"),
        ("float", "keyword"), ("Float", "keyword"), ("xor_eq", "keyword"), ("co_await", "keyword"),
        ("typeof", "keyword"),
        ("stdio", "stdio.h"), ("Math", "math.h"), ("STDINT", "stdint.h"), ("unistd", "unistd.h"),
        ("xmmintrin", "xmmintrin.h"), ("zlib", "zlib.h"), ("vector", "vector.h"),
        ("m", "libm"), ("z", "libz"), ("aux", "Windows"), ("Com1", "Windows"), ("test", "target"),
        ("mtx", "keep"), ("fe", "keep"), ("sem", "keep"), ("pthread_mutex", "keep"), ("atomic_flag", "keep"),
        ("sl", "library inside"), ("SL_math", "library inside"), ("slf_arm", "library inside"),
        ("fmu", "library inside"), ("casadi_arm", "library inside"),
    ],
)  # fmt: skip
def test_refusals_say_why(prefix: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        check_prefix(prefix)


def test_a_linker_that_reads_31_characters_tells_the_functions_apart() -> None:
    """At the longest prefix, and at no longer one."""
    longest = "a" * LONGEST_LINKED
    check_linked(longest)
    with pytest.raises(ValueError, match=r"has 27 characters, expected 26 at most: C99 promises that a linker"):
        check_linked(f"{longest}a")
    scenario = load_scenario("paper/nominal")
    for prefix, distinct in ((longest, True), (f"{longest}a", False)):
        export = bind(scenario.structure(), scenario.values(), prefix=prefix)
        header = text_files(export, TypedInterface(export))[f"include/{prefix}.h"].decode()
        names = re.findall(rf"^(?:extern )?[a-z].*?\b({prefix}_\w+)[\[(;]", header, re.MULTILINE)
        assert {f"{prefix}_{name}" for name in ("init", "step", "start", "status_text", "base_nodes")} <= set(names)
        assert (len({name[:31] for name in names}) == len(set(names))) is distinct


def test_no_standard_header_of_this_compiler_is_accepted(require_tool: Callable[..., str]) -> None:
    """The headers of C++ are the files of one folder; those of C are what its c… files stand for."""

    def preprocessed(text: str, *flags: str) -> subprocess.CompletedProcess[str]:
        command = [require_tool("g++"), "-x", "c++", "-std=c++20", *flags, "-"]
        return subprocess.run(command, input=text, capture_output=True, text=True, check=False)

    [vector] = re.findall(r"\S+/vector(?=\s)", preprocessed("#include <vector>", "-M").stdout)
    headers = {path.stem for path in Path(vector).parent.iterdir() if path.is_file() and path.suffix in ("", ".h")}
    assert {"vector", "cmath", "version", "syncstream"} <= headers
    guesses = {name[1:] for name in headers if name.startswith("c")}
    of_c = {name for name in guesses if preprocessed(f"#include <{name}.h>", "-E").returncode == 0}
    assert {"math", "stdio", "float", "stdlib"} <= of_c
    assert {name for name in headers | of_c if accepted(name)} <= {"cxxabi"}  # this compiler's alone


def test_no_word_that_a_compiler_refuses_as_a_name_is_accepted(
    tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    """The compiler says itself which of these words are none (restrict is a keyword of C alone)."""
    words = """
        alignas alignof asm auto bool break case catch char char16_t class concept const const_cast consteval
        constexpr constinit continue co_await co_return co_yield decltype default delete do double dynamic_cast else
        enum explicit export extern false float for friend goto if inline int long mutable namespace new noexcept
        nullptr operator private protected public register reinterpret_cast requires return short signed sizeof static
        static_assert static_cast struct switch template this thread_local throw true try typedef typeid typename union
        unsigned using virtual void volatile wchar_t while and bitand bitor compl not or xor restrict
    """
    compiler = require_tool("g++")
    for word in words.split():
        source = tmp_path / "word.cpp"
        source.write_text(f"int {word} = 0;\n")
        done = subprocess.run([compiler, "-std=c++20", "-fsyntax-only", source], capture_output=True, check=False)
        assert done.returncode != 0 or word == "restrict", word
        assert not accepted(word), word


def test_files_that_differ_by_letter_case_alone_are_the_same() -> None:
    check_files("arm", ["arm.c", "arm.h"], ["all.c", "Army.c"])
    with pytest.raises(ValueError, match=r"second Loop\.c"):
        check_files("Loop", ["Loop.h", "Loop.c"], ["all.c", "loop.c"])
