"""`springline reproduce`: the paper's runs, tables, figures and claims, in one folder."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from springline.codegen.files import (
    MANIFEST,
    TEMPORARY,
    Changes,
    FolderConflict,
    canonical_json,
    read_manifest,
    write_tree,
)
from springline.runner.paper.cases import GROUPS
from springline.runner.paper.claims import CLAIMS
from springline.runner.paper.evidence import Finding, judge
from springline.runner.paper.figures import FIGURES, OPEN_FIGURES
from springline.runner.paper.numbers import plain
from springline.runner.paper.report import compose, table_4
from springline.runner.paper.runs import study
from springline.runner.report import figure_files, to_html, to_markdown
from springline.runner.run import Progress

REPORT = "report.html"
_KIND = "reproduction"

# Shares of the time that simulation and drawing take.
_SIMULATED = 0.4


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What a reproduction came to.

    folder    where everything lies: report.html, report.md, numbers.json, figures/
    findings  the claims that these groups can test, with numbers and verdicts
    table     Table 4 row by row: group, case, joint, measure, unit, printed, value, change (when the step is halved)
    changes   paths that were written and removed; files that were right already are left alone
    """

    folder: Path
    findings: tuple[Finding, ...]
    table: tuple[dict[str, Any], ...]
    changes: Changes

    @property
    def report(self) -> Path:
        """The self-contained report."""
        return self.folder / REPORT


def reproduce(
    folder: Path,
    groups: Sequence[int] | None = None,
    *,
    inputs: str = "law_limit",
    overrides: Mapping[str, object] | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Reproduction:
    """Repeat the paper and write report.html, report.md, numbers.json and figures/ to `folder`.

    groups    groups of Table 2, None for the whole paper. Some groups alone give their rows of Table 4, their figures
              and the claims that they can test
    inputs    a set of what the paper does not publish: "law_limit" (paper/), "motor_limit" (paper_motor_limit/)
    overrides  values by dotted key that take the place of the scenarios' own
    force     replace a reproduction that has more than this one or was made with other overrides, and files that were
              edited since; write beside what others have put there
    progress  called now and then with the share that is done (0 .. 1)
    The same springline and compiler give the same bytes. An earlier reproduction of the same or of fewer groups is
    replaced.
    Raises FolderConflict if something else is in the way (nothing is written then), InputError for an override that
    cannot be, ValueError for a group that the paper does not have, ToolchainError if there is no C compiler.
    """
    whole = groups is None
    wanted = GROUPS if groups is None else groups
    changes_made = dict(overrides or {})
    # Seen now, not when all is computed.
    _refuse_loss(
        folder, {"groups": sorted(set(wanted)), "whole": whole, "set": changes_made, "inputs": inputs}, force=force
    )
    report = progress or (lambda share: None)
    done = study(
        wanted, whole=whole, changes=changes_made, inputs=inputs, progress=lambda share: report(_SIMULATED * share)
    )
    findings = judge(CLAIMS, done.evidence, done.halved)
    files: dict[str, bytes] = {}
    svg: dict[str, bytes] = {}
    figures = [figure for figure in (*FIGURES, *OPEN_FIGURES) if figure.possible(done)]
    for k, figure in enumerate(figures):
        drawn = figure_files(figure.name, figure.make(done))
        files |= {f"figures/{name}": content for name, content in drawn.items()}
        svg[figure.name] = drawn[f"{figure.name}.svg"]
        report(_SIMULATED + (1 - _SIMULATED) * (k + 1) / len(figures))
    document = compose(done, findings, svg)
    table = table_4(done)
    files["report.md"] = to_markdown(document).encode()
    files[REPORT] = to_html(document).encode()
    files["numbers.json"] = canonical_json({"table_4": table, "claims": [_plain_finding(f) for f in findings]})
    described = {"kind": _KIND, "groups": list(done.groups), "whole": whole, "set": changes_made, "inputs": inputs}
    changes = write_tree(folder, files, described, force=force)
    return Reproduction(folder, tuple(findings), tuple(table), changes)


def _refuse_loss(folder: Path, wanted: Mapping[str, Any], *, force: bool) -> None:
    """Raise FolderConflict if a reproduction would take something away that is in `folder`, or mix with it."""
    earlier = read_manifest(folder, _KIND)
    if earlier is None:
        if (folder / MANIFEST).exists():
            raise FolderConflict(folder, {MANIFEST: "not written by springline"}, force_helps=False)
        items = sorted(item.name for item in folder.iterdir()) if folder.is_dir() else []
        foreign = {name: "not written by this command" for name in items if not name.startswith(TEMPORARY)}
        if foreign and not force:
            raise FolderConflict(folder, foreign, force_helps=True)
        return
    groups = earlier.get("groups")
    lost = [str(group) for group in groups if group not in wanted["groups"]] if isinstance(groups, list) else []
    reason = ""
    if earlier.get("set", {}) != json.loads(canonical_json(wanted["set"])):
        reason = "lists a reproduction with other values of --set"
    elif earlier.get("inputs", "law_limit") != wanted["inputs"]:
        reason = "lists a reproduction with other --inputs"
    elif earlier.get("whole") and not wanted["whole"]:
        reason = "lists a reproduction of the whole paper, and a group alone is less than that"
    elif lost:
        reason = f"lists a reproduction that has group {', '.join(lost)} too"
    if reason and not force:
        raise FolderConflict(folder, {MANIFEST: reason}, force_helps=True)


def _plain_finding(finding: Finding) -> dict[str, Any]:
    numbers = [
        {"label": n.label, "unit": n.unit, "printed": n.printed, "value": plain(n.value), "change": plain(n.change)}
        for n in finding.numbers
    ]
    return {
        "number": finding.number,
        "claim": finding.claim,
        "verdict": finding.verdict,
        "stable": finding.stable,
        "checks": [asdict(check) for check in finding.checks],
        "numbers": numbers,
    }
