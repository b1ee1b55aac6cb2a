"""The report of a reproduction: Table 4, the claims, the theory, the figures, and what the paper leaves open."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from springline.model.base import COORDINATES
from springline.model.mechanisms import MECHANISMS
from springline.model.quantities import DQ1, DQ2, Q1, Q2
from springline.model.theory import Gap, reaching_time_bound
from springline.runner.analysis import reaching_law
from springline.runner.files import value_text
from springline.runner.paper.captions import SEEN, sea
from springline.runner.paper.cases import CASES, JOINTS, LAWS, MEASURES, UNIT, Case, cases, under
from springline.runner.paper.claims import CHATTER_ABOVE, VISIBLE, growth
from springline.runner.paper.equations import TESTED, equation, equations
from springline.runner.paper.evidence import Finding
from springline.runner.paper.figures import FIGURES, OPEN_FIGURES, PaperFigure
from springline.runner.paper.measured import Measured, first_time
from springline.runner.paper.numbers import change, exact, number, plain
from springline.runner.paper.provenance import provenance
from springline.runner.paper.runs import (
    LAYERS,
    LIMITS,
    LITERAL,
    READINGS,
    SAMPLING,
    SOLVER,
    Experiment,
    Study,
    Twice,
)
from springline.runner.paper.score import BANDS, closeness, score
from springline.runner.paper.symbols import typeset_block
from springline.runner.report import Block, Bullets, Document, Heading, Picture, Table, Text
from springline.runner.scenario import Scenario, load_scenario

TIMES = ("response_time", "settling_time")
ERRORS = ("overshoot", "steady_state_error")


def compose(study: Study, findings: Sequence[Finding], svg: Mapping[str, bytes]) -> Document:
    """The document.

    svg  figure name -> its SVG; figures that are not in it are left out
    """
    step = next(iter(study.scenarios.values())).step
    blocks: list[Block] = [*_summary(study, findings, step), *_ours(study, step)]
    blocks += [*_score(study), *_table_4(study, step), *_claims(findings), *_theory(study)]
    if study.whole:
        blocks += _left_open(study, svg)
    blocks += [Heading("Figures of the paper")]
    blocks.append(
        _prose("""A figure of a group shows the quantity over the whole run, as the paper does, then its first moments,
        then what is left once it has settled.""")
    )
    blocks += _pictures(study, FIGURES, svg)
    blocks += provenance(study)
    title = "Rapid robust control of a marine-vehicle manipulator: a reproduction"
    subtitle = """Y. Guo, S. Xu, H. Chen, H. Zheng, Z. Hao, Z. Wang, J. Mar. Sci. Eng. 2023, 11(3), 474,
        doi 10.3390/jmse11030474, repeated by springline from the paper's equations."""
    return Document(title, " ".join(subtitle.split()), [typeset_block(block) for block in blocks])


def table_4(study: Study) -> list[dict[str, Any]]:
    """Table 4 as rows of plain data: group, case, joint, measure, unit, printed, value, change when the step is halved.

    A number that does not exist (a run that diverged, or never settled) is None.
    """
    rows = []
    for case in cases(study.groups):
        for i, joint in enumerate(JOINTS):
            for measure in MEASURES:
                value, halved = (e.runs[case.scenario].metric(measure, joint) for e in (study.evidence, study.halved))
                rows.append(
                    {
                        "group": case.group,
                        "case": case.name,
                        "joint": joint,
                        "measure": measure,
                        "unit": _unit(measure, joint),
                        "printed": case.printed[measure][i] if case.printed else None,
                        "value": plain(value),
                        "change": plain(halved - value),
                    }
                )
    return rows


# Sections


def _prose(text: str) -> Text:
    return Text(" ".join(text.split()))


def _summary(study: Study, findings: Sequence[Finding], step: float) -> list[Block]:
    verbs = {"holds": ("holds", "hold"), "partly": ("holds partly", "hold partly"), "fails": ("fails", "fail")}
    count = {verdict: sum(f.verdict == verdict for f in findings) for verdict in verbs}
    words = ", ".join(f"{n} {verbs[verdict][n > 1]}" for verdict, n in count.items() if n)
    moved = ", ".join(str(f.number) for f in findings if f.stable is False)
    groups = ", ".join(map(str, study.groups))
    first = next(iter(study.scenarios.values())).document
    halving = f"Halving the step changes a check of claim {moved}." if moved else "Halving the step changes no check."
    claims = f"{len(findings)} claim{'s' if len(findings) > 1 else ''}"
    run = f"Groups {groups} of Table 2 were" if len(study.groups) > 1 else f"Group {groups} of Table 2 was"
    blocks: list[Block] = [
        Heading("Summary"),
        _prose(f"""{run} run with a fixed step of {exact(step)} s ({first["simulation"]["integrator"].upper()},
        {first["control"]["mode"]} control), and again with half of it.
        {f"Of {claims} {words}. {halving}" if findings else ""} What the paper does not publish was chosen here, and is
        listed below. Equations have the paper's numbers."""),
    ]
    if study.changes:
        changed = ", ".join(f"`{key} = {value_text(value)}`" for key, value in study.changes.items())
        blocks.append(
            _prose(f"""**This is not the paper's system**: in all runs {changed} takes the place of what is said below,
            but where an experiment varies the same.""")
        )
    if findings:
        rows = [(str(f.number), f.claim, f"[[{f.verdict}]]") for f in findings]
        blocks.append(Table(("", "claim", "verdict"), rows, labels=3))
    if not study.whole:
        blocks.append(_prose("This is a part of the reproduction: without a choice of groups it has all claims."))
    return blocks


_SHADES = dict(zip(BANDS, ("close", "near", "factor"), strict=True))
"""Band -> class of the page's style."""


def _table_4(study: Study, step: float) -> list[Block]:
    chosen = cases(study.groups)
    response, settling = _bands(study)
    bands = ", ".join(f"{colour} {band}" for colour, band in zip(("green", "pale green", "yellow"), BANDS, strict=True))
    blocks: list[Block] = [
        Heading("Table 4"),
        _prose(f"""The error is $e = q_{{1d}} - q_1$. Response time: first time at {response:g} % of the initial error.
        Settling time: last time above {settling:g} % of it. Overshoot: largest excursion of the error past zero.
        Steady-state error: largest error in the last quarter of the run. “–”: there is no such number. Ours are shaded
        by how close they come to the printed ones: {bands}; a printed 0 is met by what rounds to it."""),
    ]
    for title, names in (("Times", TIMES), ("Errors", ERRORS)):
        over = [("", 2)]
        over += [(f"{_SHORT_NAMES[name]}, {joint} [{_unit(name, joint)}]", 2) for name in names for joint in JOINTS]
        columns = ["group", "case", *(_WHOSE * 4)]
        rows: list[list[str]] = []
        shades: dict[tuple[int, int], str] = {}
        for case in chosen:
            cells = [str(case.group), case.name]
            for name in names:
                for i, joint in enumerate(JOINTS):
                    ours = study.evidence.runs[case.scenario].metric(name, joint)
                    if case.printed:
                        band = closeness(name, case.printed[name][i], ours)
                        shades[len(rows), len(cells) + 1] = _SHADES.get(band, "")
                    cells += [_printed(case, name, i), _time(ours) if name in TIMES else number(ours)]
            rows.append(cells)
        blocks.append(Table(columns, rows, title, labels=2, shades=shades, over=over))
    blocks += _halved(study, step)
    for case in chosen:
        run = study.evidence.runs[case.scenario]
        if run.status != "ok":
            blocks.append(Text(f"{case.name.capitalize()}: {_how_it_ended(run)}. Its numbers are those up to there."))
    return blocks


def _halved(study: Study, step: float) -> list[Block]:
    """What halving the step changes, run by run, and what that says of the first push."""
    rows = []
    push: dict[str, float] = {}
    for case, run in _distinct(study):
        finer = study.halved.runs[case.scenario]
        for joint in JOINTS:
            pairs = [(run.metric(m, joint), finer.metric(m, joint)) for m in MEASURES]
            anywhere = _anywhere(run, finer, joint)
            rows.append((str(case.group), case.name, joint, *(change(b - a, a) for a, b in pairs), number(anywhere, 2)))
            if not math.isnan(anywhere):
                law = str(study.scenarios[case.scenario].document["control"]["law"])
                push[law] = max(push.get(law, 0.0), anywhere)
    units = [f"{_SHORT_NAMES[m]} [{'s' if m in TIMES else 'm, rad'}]" for m in MEASURES]
    caption = f"""Change of our numbers when the step is halved to {exact(step / 2)} s. Times are multiples of the step.
        Less than 10⁻⁹ of the number is shown as 0. Steady-state errors are of the end of a run; “rates anywhere” is the
        largest change of a joint's rate at any time, the first push included. Cases that are the same run are listed
        once."""
    columns = ["group", "case", "joint", *units, "rates anywhere [m/s, rad/s]"]
    good = ", ".join(f"{number(size, 2)} ({LAWS[law]})" for law, size in push.items())
    said = f"So the transient is good to {good} m/s or rad/s, the first push included." if push else ""
    return [Table(columns, rows, " ".join(caption.split()), 3), *([Text(said)] if said else [])]


def _distinct(study: Study) -> list[tuple[Case, Measured]]:
    """The cases with their runs, without those that are the same run under another name."""
    found: dict[int, tuple[Case, Measured]] = {}
    for case in cases(study.groups):
        run = study.evidence.runs[case.scenario]
        found.setdefault(id(run), (case, run))
    return list(found.values())


def _unit(measure: str, joint: str) -> str:
    return "s" if measure in TIMES else UNIT[joint]


_WHOSE = ("paper", "ours")

_SHORT_NAMES: Mapping[str, str] = {
    "response_time": "response",
    "settling_time": "settling",
    "overshoot": "overshoot",
    "steady_state_error": "steady state",
}
"""Measure -> heading of a column that has its joint beside it."""


def _anywhere(run: Measured, finer: Measured, joint: str) -> float:
    """The largest difference of a joint's rate at any time, in its unit; NaN if a run stopped."""
    if run.status != "ok" or finer.status != "ok":
        return math.nan
    return float(np.max(np.abs(run[f"dq1_{joint}"] - finer[f"dq1_{joint}"])))


def _score(study: Study) -> list[Block]:
    """How many of Table 4's numbers were met, by measure and joint, and why not more."""
    chosen = cases(study.groups)
    runs = study.evidence.runs
    parts = [(f"{MEASURES[m]}, {joint}", [m], [joint], chosen) for m in MEASURES for joint in JOINTS]
    parts.append(("all", list(MEASURES), list(JOINTS), chosen))
    if 2 in study.groups:
        parts.append(("of these, group 2", list(MEASURES), list(JOINTS), cases([2])))
    rows = []
    for name, measures, joints, of in parts:
        met = score(of, runs, measures, joints)
        if met.total:
            rows.append((name, str(met.total), *map(str, met.within.values())))
    if not rows:
        return []
    for other, found in study.beside.items():
        met = score(cases([2]), found, list(MEASURES), list(JOINTS))
        rows.append((f"group 2 under {_SETS[other]}", str(met.total), *map(str, met.within.values())))
    return [
        Heading("Score"),
        Table(("numbers of Table 4", "printed", *BANDS), rows, labels=1),
        *_both(study),
        Text("Why not more, by column:"),
        Bullets(_reasons(study)),
    ]


_SETS: Mapping[str, str] = {
    "law_limit": "the limit on the law's acceleration",
    "motor_limit": "the limit on the motors' force",
}
"""Sets of INPUTS, in words."""
_LIMITED: Mapping[str, str] = {"law_limit": "law limited", "motor_limit": "motors limited"}
"""The same for headings of columns."""


def _both(study: Study) -> list[Block]:
    """What the two readings of the limit that the paper must have had, and does not state, come to (E5, E11)."""
    if not study.beside:
        return []
    (other,) = study.beside
    ours = score(cases([2]), study.evidence.runs, list(MEASURES), list(JOINTS)).within["within 30 %"]
    theirs = score(cases([2]), study.beside[other], list(MEASURES), list(JOINTS)).within["within 30 %"]
    return [
        _prose(f"""The paper states no limit, and must have had one. This report reads it as
        {_SETS[study.inputs]}{_searched(study.inputs)}: {ours} of group 2's 24 numbers lie within 30 %. Read as
        {_SETS[other]}{_searched(other)} (`springline reproduce --inputs {other}`), {theirs} do. Either is one set of
        inputs for all three laws."""),
        _side_by_side(study, other),
    ]


def _searched(inputs: str) -> str:
    """How the rest of a set was chosen, where by a search."""
    return ", with all else that is open found by a search for the most" if inputs == "motor_limit" else ""


def _side_by_side(study: Study, other: str) -> Table:
    """Group 2's numbers as printed, and under both sets of inputs."""
    sets = (study.evidence.runs, study.beside[other])
    over = [("", 2)] + [(joint, 1 + len(sets)) for joint in JOINTS]
    columns = ["law", "", *(("paper", *(_LIMITED[name] for name in (study.inputs, other))) * len(JOINTS))]
    rows: list[list[str]] = []
    shades: dict[tuple[int, int], str] = {}
    for case in cases([2]):
        for measure in MEASURES:
            cells = [case.name, f"{_SHORT_NAMES[measure]} [{'s' if measure in TIMES else 'm, rad'}]"]
            for i, joint in enumerate(JOINTS):
                cells.append(_printed(case, measure, i))
                for runs in sets:
                    ours = runs[case.scenario].metric(measure, joint)
                    if case.printed:
                        band = closeness(measure, case.printed[measure][i], ours)
                        shades[len(rows), len(cells)] = _SHADES.get(band, "")
                    cells.append(_time(ours) if measure in TIMES else number(ours))
            rows.append(cells)
    return Table(columns, rows, "Group 2 under both readings of the limit", labels=2, shades=shades, over=over)


def _reasons(study: Study) -> list[str]:
    """Why a column of Table 4 is not met, a sentence each (E5, E10, E11)."""
    evidence = study.evidence
    first = next(iter(evidence.runs.values()))
    initial = [abs(float(first[f"e_{joint}"][0])) for joint in JOINTS]
    response, settling = _bands(study)
    surface = evidence.inherent.surface_time("lift", initial[0], response / 100 * initial[0])
    printed = {case.scenario: case.printed for case in CASES if case.printed}
    new = printed["paper/group2_variable_power_log"]["response_time"][0]
    same = printed["paper/group1_shake"]["response_time"][0]
    left = {law: printed[f"paper/group2_{law}"]["steady_state_error"] for law in list(LAWS)[1:]}
    shares = {law: 100 * error[0] / initial[0] for law, error in left.items()}
    each = " and ".join(f"{share:.0f} % ({LAWS[law]})" for law, share in shares.items())
    heaves = "; ".join(
        f"{LAWS[law]}: {number(evidence.heave_for(law, 'lift', lift))} and "
        f"{number(evidence.heave_for(law, 'rotation', turn))} m/s²"
        for law, (lift, turn) in left.items()
    )
    another = ", so that this number was measured in another way" if surface > new else ""
    wider = ", so that the bands it settles into must be wider than those" if min(shares.values()) > settling else ""
    name = {measure: title.capitalize() for measure, title in MEASURES.items()}
    return [
        f"{name['response_time']}: the printed surface alone (22) takes {number(surface, 2)} s to {response:g} % of "
        f"the lift's initial error, and Table 4 prints {new:.2f} s{another}; its group 1 prints {same:.2f} s for the "
        "same run.",
        f"{name['settling_time']}: into {settling:g} % here. The steady-state errors that Table 4 prints of the "
        f"traditional laws are {each} of the lift's initial error{wider}; the paper states no bands.",
        f"{name['overshoot']}: what overshoots is a motor that cannot brake in time. {_limited(study)} The paper "
        "states no limit at all.",
        f"{name['steady_state_error']}: it follows from the heave, which is not published. Table 4's errors of the "
        f"lift and of the rotation would, held at rest, take different heaves ({heaves}), so that no heave gives both.",
    ]


def _bands(study: Study) -> tuple[float, float]:
    """Shares of the initial error to which a joint responds and into which it settles, %."""
    simulation = next(iter(study.scenarios.values())).document["simulation"]
    return 100 * simulation["response_band"], 100 * simulation["settling_band"]


def _limited(study: Study) -> str:
    """What is limited in the packaged inputs, as a sentence."""
    control = next(iter(study.scenarios.values())).document["control"]
    law, motors = (any(math.isfinite(x) for x in _values(control[key])) for key in ("a_max", "U_max"))
    if law and motors:
        return "Here the law's acceleration is limited, and the motors' force."
    if law:
        return "Here the law's acceleration is limited and the motors' force is not."
    return f"Here the law's acceleration is not limited{', the motors’ force is' if motors else ', nor is any force'}."


def _time(value: float, decimals: int = 3) -> str:
    return "–" if math.isnan(value) else f"{value:.{decimals}f}".replace("-", "−")


def _printed(case: Case, measure: str, i: int) -> str:
    """A number of Table 4; times as they are printed, with two decimals."""
    if not case.printed:
        return "n/a"
    value = case.printed[measure][i]
    return f"{value:.2f}" if measure in TIMES else exact(value)


def _claims(findings: Iterable[Finding]) -> list[Block]:
    blocks: list[Block] = [
        Heading("Claims"),
        _prose("""A claim's verdict follows from its checks: all met, it [[holds]]; some, [[partly]]; none, it
        [[fails]]. Before them stand the equations that it tests. “Change” is what halving the step adds."""),
    ]
    shown: dict[str, int] = {}
    for finding in findings:
        marks = []
        for check in finding.checks:
            why = f". **Not met:** {check.why}." if check.why and not check.met else ""
            marks.append(f"{'✓' if check.met else '✗'} {check.text}{why}")
        printed = any(n.printed is not None for n in finding.numbers)
        rows = []
        for n in finding.numbers:
            paper = [_as_printed(n.printed, n.unit)] if printed else []
            ours = _time(n.value, 4) if n.unit == "s" and abs(n.value) < 1 else number(n.value, 4)
            rows.append((n.label, n.unit, *paper, ours, change(n.change, n.value)))
        blocks += [
            Heading(f"Claim {finding.number} [[{finding.verdict}]]", 3),
            Text(finding.claim),
            *_tested(finding.number, shown),
            Bullets(marks, marked=True),
            *([Text(f"{finding.note}.")] if finding.note else []),
            Table(["number", "unit", *(["paper"] if printed else []), "ours", "change"], rows, labels=2),
        ]
    return blocks


def _tested(claim: int, shown: dict[str, int]) -> list[Block]:
    """The equations that a claim tests; of those that stand at an earlier claim, that they do.

    shown  equation -> claim at which it stands, which this adds to
    """
    tested = TESTED[claim]
    new = [name for name in tested.equations if name not in shown]
    places: dict[int, list[str]] = {}
    for name in tested.equations:
        if name in shown:
            places.setdefault(shown[name], []).append(equation(name).label)
    shown |= dict.fromkeys(new, claim)
    old = ", ".join(f"{', '.join(dict.fromkeys(labels))} see claim {at}" for at, labels in places.items())
    text = f"{tested.intro}{f'; for {old}' if old else ''}{':' if new else '.'}"
    return [Text(text), *equations(new)]


def _as_printed(value: float | None, unit: str) -> str:
    """A number as the paper prints it: Table 4's times, which are below a second or two, with two decimals."""
    if value is None:
        return ""
    return f"{value:.2f}" if unit == "s" and value < 1 else f"{value:.3g}"


def _theory(study: Study) -> list[Block]:
    distinct = [
        (case, run, study.evidence.theory[case.scenario])
        for case, run in _distinct(study)
        if case.scenario in study.evidence.theory
    ]
    met, times = [], []
    for case, run, theory in distinct:
        for i, joint in enumerate(JOINTS):
            bounds, margin = theory.bounds, theory.margin
            name = (f"{case.group}", case.name, joint)
            sizes = (margin.per_joint[i], margin.bound, margin.c1, theory.disturbed.per_joint[i])
            met.append((*name, *map(number, (*sizes, theory.residual[i], theory.remaining[i]))))
            limits = (bounds.sliding[i], bounds.reaching, bounds.total[i], run.metric("settling_time", joint))
            times.append((*name, *map(number, limits)))
    acceleration, rate = "[m/s², rad/s²]", "[m/s, rad/s]"
    columns = [f"largest |H⁻¹S| {acceleration}", f"S̄0 {acceleration}", f"k1 − S̄0 {acceleration}"]
    columns += [f"largest $|d|$ {acceleration}", f"residual |σ| {rate}", f"largest |σ| {rate}"]
    caption = """What the laws meet. $d$ is σ̇ less what the law asks for: the disturbance as the law meets it, springs
        and a payload that the controller does not know included. Its largest size is that after the first quarter of
        the run, that of σ is of the second half. “Residual |σ|”: below it the law asks for less than the largest $|d|$,
        so that |σ| need not become smaller."""
    gaps = {gap: sum(gap in theory.gaps for _, _, theory in distinct) for gap in Gap}
    items = [f"{count} of {len(distinct)} runs: {gap.value}." for gap, count in gaps.items() if count]
    items += [
        rf"With the boundary layer the tail of $e$ decays at $\lambda \delta^{{p/r - 1}}$ = {number(theory.tail)} 1/s."
        for _, _, theory in distinct[:1]
    ]
    # Every case starts from the same state, and so from the same σ(0).
    start = [float(next(iter(study.evidence.runs.values()))[f"sigma_{joint}"][0]) for joint in JOINTS]
    scenario = next(iter(study.scenarios.values()))
    zeta, duration = float(scenario.document["control"]["zeta"]), scenario.step * scenario.steps
    promised = {c1: reaching_time_bound(start, c1, zeta) for c1 in (3.0, 2.0, 1.0)}
    listed = ", ".join(f"{number(time)} s for c1 = {c1:g}" for c1, time in promised.items())
    proves = (
        f"""More than the {duration:g} s of a run, so that a measured time below it proves
        little."""
        if min(promised.values()) > duration
        else ""
    )
    return [
        Heading("Theory against measurement"),
        _prose("""The sliding phase takes less than t_smax (Theorem 1), the reaching phase less than t_q if k1 exceeds
        the bound S̄0 on the acceleration H⁻¹S that the base oscillation asks for; t_a is their sum:"""),
        *equations(("Theorem 1", "reaching", "32")),
        _prose(f"S̄0 is measured along each run, as the largest norm of H⁻¹S. t_q is {listed}. {proves}"),
        Table(["group", "case", "joint", *columns], met, " ".join(caption.split()), labels=3),
        Table(
            ["group", "case", "joint", "t_smax [s]", "t_q [s]", "t_a [s]", "settling time [s]"],
            times,
            "Bounds and measured times. ∞: no bound.",
            labels=3,
        ),
        Text("Where the proof does not reach these runs:"),
        Bullets(items),
    ]


def _pictures(study: Study, figures: Iterable[PaperFigure], svg: Mapping[str, bytes]) -> list[Block]:
    return [
        Picture(f"figures/{f.name}", svg[f.name], f"{f.caption} {SEEN[f.name](study)}")
        for f in figures
        if f.name in svg
    ]


def _left_open(study: Study, svg: Mapping[str, bytes]) -> list[Block]:
    readings, laws = [], {}
    for key, (run, half) in study.readings.items():
        values = [each.variation_rate("sigma_lift", 1.0) for each in (run, half)]
        values += [each.largest("e_lift", 0.25) for each in (run, half)]
        readings.append((READINGS[key].name, *map(number, values)))
        if key in ("power", "base"):
            laws[key] = _steepest(
                load_scenario(under(study.inputs, "paper/nominal"), {**study.changes, **READINGS[key].overrides})
            )
    literal = study.literal["unlimited"][0]
    asked = float(np.abs(study.evidence.laws["variable_power_log"](literal["sigma_lift"][:1]))[0])
    sizes = {key: study.readings[key][0].largest("sigma_lift", 0.25) for key in laws}
    columns = ("settling time, lift / rotation [s]", "steady-state error, lift [m]", "half the step [m]", "")
    literal_figure, readings_figure, decisions_figure = (_pictures(study, [figure], svg) for figure in OPEN_FIGURES)
    return [
        Heading("As printed"),
        _prose("The law as it is printed follows from the surface (22) and its derivative:"),
        equation("25"),
        _prose(f"""At $t = 0$ it asks the lift for {number(asked, 2)} m/s², and the last term of (25) has no bound where
        $e$ passes 0. The paper states no limit. Taken literally, without and with a limit on the reaching law, base at
        rest:"""),
        Table(("", *columns), _outcomes(study.literal, LITERAL), labels=1, words=(4,)),
        *literal_figure,
        _prose(rf"""The logarithms of (18) are set with $1 + \alpha$ and $1 - \alpha$ beside them. Read as exponents,
        the law's slope is {number(laws["power"][0], 2)} 1/s at most up to |σ| = 1. Read as bases (with the sign of the
        last term that lets it point at the surface) it reaches {number(laws["base"][0], 2)} 1/s at |σ| =
        {number(laws["base"][1], 2)}. A shake of 0.07 sin 11$t$ m takes |σ| of the lift to {number(sizes["power"], 2)}
        m/s with the one reading and to {number(sizes["base"], 2)} m/s with the other. From 1 s on:"""),
        Table(
            ("", "variation of σ, lift [m/s per s]", "half the step", "largest error, lift [m]", "half the step [m]"),
            readings,
            labels=1,
        ),
        *readings_figure,
        Heading("What δ and a_max do"),
        _prose("""The boundary layer δ in the surface's last term, and the limit a_max on the reaching law, are ours.
        The printed surface is that for δ = 0:"""),
        equation("layer"),
        _prose("Base at rest:"),
        Table(("δ in m or rad", *columns), _outcomes(study.layers, LAYERS), labels=1, words=(4,)),
        Table(("a_max in m/s² or rad/s²", *columns), _outcomes(study.limits, LIMITS), labels=1, words=(4,)),
        *decisions_figure,
        Heading("Sampling and the solver's step"),
        _prose("""The paper does not say whether its control is sampled. Under shake, with control once in a period and
        held between:"""),
        Table(_SAMPLED, _sampled(study.sampling), labels=1, words=(3,)),
        _prose(r"""Without fast control the springs are not damped: they flutter (claim 8), and how long a run lasts
        depends on what hides that. A solver's step can: a step $h$ of RK4 changes the energy $E$ of an undamped
        oscillation at $\omega$ by"""),
        equation("Runge-Kutta"),
        _prose(_by_the_solver(study)),
        _prose("""So can motors with a limit, which push less hard. The paper shows its run to 3.6 s:"""),
        Table(
            ("", "lift off by 0.5 m [s]", "end of the run [s]", "half the step [s]", ""),
            _lasting(study.solver),
            labels=1,
            words=(4,),
        ),
    ]


def _steepest(scenario: Scenario) -> tuple[float, float]:
    """The largest slope (1/s) of a scenario's reaching law up to |sigma| = 1, and |sigma| there."""
    sigma = np.geomspace(1e-4, 1.0, 2001)
    slope = np.gradient(np.abs(reaching_law(scenario)(sigma)), sigma)
    return float(np.max(slope)), float(sigma[np.argmax(slope)])


def _by_the_solver(study: Study) -> str:
    """How fast RK4 alone damps the flutter at the coarse experiment's step, beside how fast it grows."""
    off, on = (study.evidence.runs[f"paper/group4_fast_{name}"] for name in ("off", "on"))
    rows = min(len(off["t"]), len(on["t"]))
    h = float(SOLVER["coarse"].overrides["simulation.step"])
    said = []
    for joint in JOINTS:
        rate, frequency = growth(off["t"][:rows], off[f"dq1_{joint}"][:rows] - on[f"dq1_{joint}"][:rows])
        z = 2 * math.pi * frequency * h
        decay = -math.log(1 - z**6 / 72 + z**8 / 576) / (2 * h)
        said.append(
            f"of the {joint} ({number(frequency)} Hz) at {number(decay, 2)} 1/s, where with a fine step it grows at "
            f"{number(rate, 2)} 1/s"
        )
    return f"With $h$ = {exact(1e3 * h)} ms that alone damps claim 8's flutter {'; that '.join(said)}."


_SAMPLED = ("", f"lift's velocity above {CHATTER_ABOVE:g} Hz, RMS [m/s]", "half the step [m/s]", "")


def _sampled(runs: Mapping[str, Twice]) -> list[tuple[str, ...]]:
    rows = []
    for key, (run, half) in runs.items():
        ripples = [each.ripple("dq1_lift", CHATTER_ABOVE) if each.status == "ok" else math.nan for each in (run, half)]
        quickest = float(np.max(np.abs(run["dq1_lift"]))) if run.status == "ok" else math.nan
        seen = "chatters" if ripples[0] > VISIBLE * quickest else "tracks"
        ended = f"diverges after {number(run.end, 2)} s" if run.status != "ok" else seen
        rows.append((SAMPLING[key].name, *map(number, ripples), ended))
    return rows


def _lasting(runs: Mapping[str, Twice]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for key, (run, half) in runs.items():
        late = run["t"] > 0.5  # the error is larger than that at the start
        off = first_time(run["t"][late], np.abs(run["e_lift"][late]) > 0.5)
        rows.append((SOLVER[key].name, number(off), number(run.end), number(half.end), run.status.replace("_", " ")))
    return rows


def _outcomes(runs: Mapping[str, Twice], table: Mapping[str, Experiment]) -> list[tuple[str, ...]]:
    rows = []
    for key, (run, half) in runs.items():
        settling = " / ".join(number(run.metric("settling_time", joint)) for joint in JOINTS)
        errors = [number(each.metric("steady_state_error", "lift")) for each in (run, half)]
        rows.append((table[key].name, settling, *errors, _what_happens(run)))
    return rows


_LEFT = re.compile(r"(\w+) left its bound \(\|\w+\| <= (\S+)\) at t = (\S+) s")


def _how_it_ended(run: Measured) -> str:
    """Why a run stopped, without the name of its status, and in words where a quantity left its bound."""
    told = run.message.partition(": ")[2] or run.message
    found = _LEFT.search(told)
    if found is None:
        return told
    for quantity in (Q1, DQ1, Q2, DQ2):
        for entry in quantity.entries(MECHANISMS["transfer_manipulator"].joints):
            if entry.name == found[1] and entry.joint is not None:
                size = exact(float(found[2]))
                words = quantity.meaning.partition(",")[0]
                return f"the {words} of the {entry.joint.name} passes {size} {entry.unit} at {found[3]} s"
    return told


def _what_happens(run: Measured) -> str:
    """In a word: divergence, chatter, or tracking."""
    if run.status != "ok":
        return f"diverges after {exact(run.end)} s" if run.end < 0.001 else f"diverges after {number(run.end, 2)} s"
    errors = [run.metric("steady_state_error", joint) / abs(float(run[f"e_{joint}"][0])) for joint in JOINTS]
    if max(errors) > 0.05:
        return "chatters beyond 5 %"
    return "chatters" if max(errors) > 0.001 else "tracks"


def _ours(study: Study, step: float) -> list[Block]:
    document = next(iter(study.scenarios.values())).document
    control, mechanism, simulation = document["control"], document["mechanism"], document["simulation"]
    rod = mechanism["m3"] * mechanism["L3"] ** 2 / 3
    slender = " (m3 L3²/3: a slender rod, its centroid at L3)" if math.isclose(mechanism["J"], rod) else ""
    start = document["initial"]["q_motor"]
    springs = f"springs {start} at the start" if isinstance(start, str) else "motors at the start as said"
    items = [
        f"$J$ = {mechanism['J']:.4g} kg m²{slender}, L1 = {mechanism['L1']:g} m.",
        f"Boundary layer δ = {control['delta']:g} m or rad; limit a_max on the reaching law: "
        f"{_limits(control['a_max'], ('m/s²', 'rad/s²'))}; limit U_max on the motors: "
        f"{_limits(control['U_max'], ('N', 'N m'))}.",
        f"Solver: {simulation['integrator'].upper()} with a step of {exact(step)} s; {control['mode']} control; "
        f"{springs}.",
        "Thresholds of response and settling time, and every threshold of the claims.",
        "“Payload 1” and “payload 2” are +20 % and −20 % of the plant's m3 and $J$.",
    ]
    motions: dict[str, Case] = {}
    for case in cases(study.groups):
        motions.setdefault(_motion(study.scenarios[case.scenario]), case)
    items += [f"Base motion ({case.name} of group {case.group}): {motion}." for motion, case in motions.items()]
    if 1 in study.groups:
        items.append(sea(study))
    return [Heading("What is ours"), Text("Not published, and chosen here:"), Bullets(items)]


def _values(value: Any) -> list[float]:
    return [float(v) for v in value] if isinstance(value, list) else [float(value)]


def _limits(value: Any, units: tuple[str, str]) -> str:
    values = _values(value)
    if not any(map(math.isfinite, values)):
        return "none"
    if len(set(values)) == 1:
        return f"{exact(values[0])} {units[0]} or {units[1]}"
    return " and ".join(f"{exact(v)} {unit}" for v, unit in zip(values, units, strict=True))


def _motion(scenario: Scenario) -> str:
    parts = []
    for coordinate in COORDINATES:
        terms = scenario.document["base_motion"].get(coordinate.key, [])  # another kind has no terms
        degrees = coordinate.unit == "rad"
        scale, unit = (180 / math.pi, "°") if degrees else (1.0, coordinate.unit)
        sines = " + ".join(f"{scale * t['amplitude']:.4g} sin({t['omega']:g}$t${_phase(t['phase'])})" for t in terms)
        if sines:
            sines = f"({sines})" if len(terms) > 1 else sines
            parts.append(f"{coordinate.alias or coordinate.key} {sines} {unit}, $t$ in s")
    return "; ".join(parts) or "none"


def _phase(phase: float) -> str:
    return f" {phase:+.4g}" if phase else ""
