"""What MISRA C:2012 has to say to an export is what docs/embedding.md says: rule, count, and why it is accepted."""

import os
import re
import subprocess
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from springline.codegen.export import bind
from springline.codegen.export.c.tree import generate_files
from springline.codegen.files import write_tree
from springline.codegen.program import Real
from springline.runner.scenario import load_scenario

PAGE = Path(__file__).parents[4] / "docs" / "embedding.md"
ROW = re.compile(r"^\| (\d+\.\d+) \| (\d+) \| (.+) \|$", re.MULTILINE)
# What <float.h> and <stdint.h> say, which cppcheck does not read.
TARGET = (
    *("FLT_RADIX=2", "DBL_MANT_DIG=53", "DBL_MIN_EXP=-1021", "DBL_MAX_EXP=1024", "FLT_EVAL_METHOD=0"),
    *("FLT_MANT_DIG=24", "FLT_MIN_EXP=-125", "FLT_MAX_EXP=128", "UINT32_MAX=0xffffffffU", "UINT32_C(c)=c##U"),
    *("UINT64_MAX=0xffffffffffffffffUL", "UINT64_C(c)=c##UL", "__STDC_VERSION__=199901L"),
)
# Precedence that a reader would have to know, and a body without braces on a line of its own.
NOWHERE = {"12.1", "15.6"}


def findings(cppcheck: str, folder: Path) -> Counter[str]:
    """Places by rule in src/ and include/. Fails for anything that cppcheck itself complains of."""
    command = [
        *(cppcheck, "--addon=misra", "--std=c99", "--platform=unix64", "--quiet"),
        *("--template={file}:{line}:{column} {id}", "-Iinclude", "-Isrc"),
        *(f"-D{macro}" for macro in TARGET),
        *sorted(str(path.relative_to(folder)) for path in folder.glob("src/*.c")),
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    places = {line for line in done.stderr.splitlines() if line}  # a header is read once per file
    rules = [re.fullmatch(r"\S+ misra-c2012-(\d+\.\d+)", place) for place in places]
    assert all(rules), f"cppcheck found more than MISRA: {sorted(places)[:5]}"
    return Counter(rule[1] for rule in rules if rule)


def in_order(rule: str) -> list[int]:
    return [int(part) for part in rule.split(".")]


def test_the_page_lists_what_misra_finds(tmp_path: Path, require_tool: Callable[..., str]) -> None:
    cppcheck = require_tool("cppcheck", "apt-get install cppcheck")
    page = PAGE.read_text()
    [wanted] = re.findall(r"cppcheck (\d+\.\d+)", page)
    version = subprocess.run([cppcheck, "--version"], capture_output=True, text=True, check=True).stdout.split()[-1]
    if version != wanted and os.environ.get("CI") != "true":
        pytest.skip(f"cppcheck {version} counts differently from {wanted}, which docs/embedding.md was made with")
    loaded = load_scenario("paper/nominal")
    write_tree(tmp_path / "export", *generate_files(bind(loaded.structure(), loaded.values())))
    found = findings(cppcheck, tmp_path / "export")
    assert len(found) > 5, "the addon did not run"
    reasons = {rule: reason for rule, _, reason in ROW.findall(page)}
    listed = {rule: int(count) for rule, count, _ in ROW.findall(page)}
    rows = [f"| {rule} | {found[rule]} | {reasons.get(rule, 'WHY?')} |" for rule in sorted(found, key=in_order)]
    assert listed == dict(found), "docs/embedding.md lists other findings; its rows are now:\n" + "\n".join(rows)
    assert list(listed) == sorted(listed, key=in_order)


@pytest.mark.parametrize("real", ["double", "float"])
def test_no_export_leaves_precedence_or_a_body_to_the_reader(
    tmp_path: Path, require_tool: Callable[..., str], real: Real
) -> None:
    """The default export, which the page counts, has no limit of the command and no parameter to check."""
    cppcheck = require_tool("cppcheck", "apt-get install cppcheck")
    loaded = load_scenario("paper/nominal", {"control.U_max": 300.0})
    tree = generate_files(bind(loaded.structure(), loaded.values(), tunable="all", real=real))
    write_tree(tmp_path / "export", *tree)
    found = findings(cppcheck, tmp_path / "export")
    assert len(found) > 5, "the addon did not run"
    assert not NOWHERE & set(found)
