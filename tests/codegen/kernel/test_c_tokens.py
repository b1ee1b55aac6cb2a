"""Tokens of C: the same for texts that are the same program, others for any other."""

import subprocess
from collections.abc import Callable

import pytest

from springline.codegen.kernel import runtime_sources, tokens


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("a/* b */c", "a c"),
        ("a // b\nc", "a\n\n  c"),
        ("x = /* one\n * two */ 1;", "x=1;"),
        ("a /* // */ b", "a b"),
        ("a // /*\nb // */\n", "a b"),
        ("#define A 1 /* one\n of many */ + 2\nx", "#define A 1+2\nx"),
        ("  #  define A  1 // one\nx", "#define A 1\n\n\nx"),
        ("#define A \\\n  1\nx", "#define A 1\nx"),
        ("lo\\\nng x;", "long x;"),
        ('f("a" /* b */ "c")', 'f("a""c")'),
        ("x", "x\n"),
    ],
)
def test_comments_and_white_space_count_for_nothing(text: str, same: str) -> None:
    assert tokens(text) == tokens(same)


@pytest.mark.parametrize(
    ("text", "other"),
    [
        ("a b", "ab"),
        ("a + +b", "a ++b"),
        ("a - -b", "a-- b"),
        ("a / *b", "a /*b*/"),
        ("a < < b", "a << b"),
        ("1.0e - 3", "1.0e-3"),
        ("0x1p-2", "0x1p-3"),
        ("#define f(x) 1", "#define f (x) 1"),
        ("#define A 1\n+ 2", "#define A 1 + 2"),
        ("#if A\nb\n#endif", "#if A b\n#endif"),
        ('"a  b"', '"a b"'),
        ('"/* a */"', '" "'),
        ('"// a"', '"'),
        (r'"\"/*" a "*/"', r'"\"" "*/"'),
        ("'\"' /* a */ '\"'", "'\"' '\"' b"),
        ("L'a'", "L 'a'"),
    ],
)
def test_what_the_compiler_sees_counts(text: str, other: str) -> None:
    assert tokens(text) != tokens(other)


@pytest.mark.parametrize("name", runtime_sources())
def test_gcc_takes_away_the_same(name: str, require_tool: Callable[..., str]) -> None:
    """gcc's preprocessor, told to keep directives and to expand nothing, removes comments from a source."""
    text = runtime_sources()[name]
    command = [require_tool("gcc"), "-fpreprocessed", "-dD", "-E", "-P", "-x", "c", "-"]
    bare = subprocess.run(command, input=text, capture_output=True, text=True, check=True).stdout
    assert len(bare) < len(text)
    assert tokens(bare) == tokens(text)
    assert not any("/*" in token or "//" in token for token in tokens(text))
