"""The report of a reproduction: Table 4, the claims, the theory, the figures, and what the paper leaves open."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from springline.model.base import COORDINATES
from springline.model.theory import Gap, reaching_time_bound
from springline.runner.analysis import Proof
from springline.runner.files import value_text
from springline.runner.paper.captions import SEEN
from springline.runner.paper.cases import CASES, JOINTS, LAWS, MEASURES, UNIT, Case, cases
from springline.runner.paper.claims import CHATTER_ABOVE
from springline.runner.paper.evidence import Evidence, Finding
from springline.runner.paper.figures import FIGURES, OPEN_FIGURES, PaperFigure
from springline.runner.paper.measured import Measured, first_time
from springline.runner.paper.numbers import change, number, plain
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
from springline.runner.report import Block, Bullets, Document, Heading, Picture, Table, Text
from springline.runner.scenario import Scenario

TIMES = ("response_time", "settling_time")
ERRORS = ("overshoot", "steady_state_error")


def compose(study: Study, findings: Sequence[Finding], svg: Mapping[str, bytes]) -> Document:
    """The document.

    svg  figure name -> its SVG; figures that are not in it are left out
    """
    step = next(iter(study.scenarios.values())).step
    blocks: list[Block] = [*_summary(study, findings, step), *_score(study), *_table_4(study, step)]
    blocks += _claims(findings)
    blocks += [*_theory(study), Heading("Figures")]
    blocks.append(
        _prose("""A figure of a group shows the quantity over the whole run, as the paper does, then its first moments,
        then what is left once it has settled.""")
    )
    blocks += _pictures(study, FIGURES, svg)
    if study.whole:
        blocks += _left_open(study, svg)
    blocks += _ours(study, step)
    title = "Rapid robust control of a marine-vehicle manipulator: a reproduction"
    subtitle = """Y. Guo, S. Xu, H. Chen, H. Zheng, Z. Hao, Z. Wang, J. Mar. Sci. Eng. 2023, 11(3), 474,
        doi 10.3390/jmse11030474, repeated by springline from the paper's equations."""
    return Document(title, " ".join(subtitle.split()), blocks)


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
                        "unit": "s" if measure in TIMES else UNIT[joint],
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
    verbs = {"holds": "hold", "partly": "hold partly", "fails": "fail"}
    count = {verdict: sum(f.verdict == verdict for f in findings) for verdict in verbs}
    words = ", ".join(f"{count[verdict]} {verb}" for verdict, verb in verbs.items() if count[verdict])
    moved = ", ".join(str(f.number) for f in findings if f.stable is False)
    groups = ", ".join(map(str, study.groups))
    blocks: list[Block] = [
        Heading("Summary"),
        _prose(f"""Groups {groups} of Table 2 were run with a fixed step of {number(step, 1)} s (RK4, continuous
        control), and again with half of it. Of {len(findings)} claims {words}.
        {f"Halving the step changes a check of claim {moved}." if moved else "Halving the step changes no verdict."}
        What the paper does not publish was chosen here and is listed at the end."""),
    ]
    if study.changes:
        changed = ", ".join(f"`{key} = {value_text(value)}`" for key, value in study.changes.items())
        blocks.append(
            _prose(f"""**This is not the paper's system**: in all runs {changed} takes the place of what is said below,
            but where an experiment varies the same.""")
        )
    if findings:
        rows = [(str(f.number), f.claim, f"[[{f.verdict}]]") for f in findings]
        blocks.append(Table(("claim", "", "verdict"), rows, labels=3))
    if not study.whole:
        blocks.append(_prose("This is a part of the reproduction: without a choice of groups it has all claims."))
    return blocks


_SHADES = dict(zip(BANDS, ("close", "near", "factor"), strict=True))
"""Band -> class of the page's style."""


def _table_4(study: Study, step: float) -> list[Block]:
    chosen = cases(study.groups)
    bands = ", ".join(f"{colour} {band}" for colour, band in zip(("green", "pale green", "yellow"), BANDS, strict=True))
    blocks: list[Block] = [
        Heading("Table 4"),
        _prose(f"""Response time: first time at 10 % of the initial error. Settling time: last time above 5 % of it.
        Overshoot: largest excursion of the error past zero. Steady-state error: largest error in the last quarter of
        the run. “–”: there is no such number. Ours are shaded by how close they come to the printed ones:
        {bands}; a printed 0 is met by what rounds to it."""),
    ]
    for title, names in (("Times [s]", TIMES), ("Errors [m, rad]", ERRORS)):
        columns = ["group", "case"]
        columns += [f"{_SHORT_NAMES[name]}, {joint}: {whose}" for name in names for joint in JOINTS for whose in _WHOSE]
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
        blocks.append(Table(columns, rows, title, labels=2, shades=shades))
    rows = []
    for case in chosen:
        run, finer = (evidence.runs[case.scenario] for evidence in (study.evidence, study.halved))
        pairs = [[(run.metric(m, joint), finer.metric(m, joint)) for joint in JOINTS] for m in MEASURES]
        cells = [" / ".join(change(b - a, a) for a, b in pair) for pair in pairs]
        rows.append([str(case.group), case.name, *cells, _anywhere(run, finer)])
    caption = f"""Change of our numbers, lift / rotation, when the step is halved to {number(step / 2, 1)} s [s, m /
        rad]. Times are multiples of the step. Less than 10⁻⁹ of the number is shown as 0. Steady-state errors are of
        the end of a run; “rates anywhere” is the largest change of the joints' rates at any time, the first push
        included [m/s, rad/s]."""
    blocks.append(Table(["group", "case", *MEASURES.values(), "rates anywhere"], rows, " ".join(caption.split()), 2))
    for case in chosen:
        run = study.evidence.runs[case.scenario]
        if run.status != "ok":
            blocks.append(Text(f"{case.name.capitalize()}: {_how_it_ended(run)}. Its numbers are those up to there."))
    return blocks


_WHOSE = ("paper", "ours")

_SHORT_NAMES: Mapping[str, str] = {
    "response_time": "response",
    "settling_time": "settling",
    "overshoot": "overshoot",
    "steady_state_error": "steady state",
}
"""Measure -> heading of a column that has its joint beside it."""


def _anywhere(run: Measured, finer: Measured) -> str:
    """The largest difference of the joints' rates at any time, lift / rotation; "–" if a run stopped."""
    if run.status != "ok" or finer.status != "ok":
        return "–"
    gaps = (np.max(np.abs(run[f"dq1_{joint}"] - finer[f"dq1_{joint}"])) for joint in JOINTS)
    return " / ".join(number(float(gap), 2) for gap in gaps)


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
    return [
        Heading("Score"),
        Table(("numbers of Table 4", "printed", *BANDS), rows, labels=1),
        Text("Why not more, by column:"),
        Bullets(_reasons(study.evidence)),
    ]


def _reasons(evidence: Evidence) -> list[str]:
    """Why a column of Table 4 is not met, a sentence each (E5, E10, E11)."""
    first = next(iter(evidence.runs.values()))
    initial = [abs(float(first[f"e_{joint}"][0])) for joint in JOINTS]
    surface = evidence.inherent.surface_time("lift", initial[0], 0.1 * initial[0])
    printed = {law: next(c for c in CASES if c.scenario == f"paper/group2_{law}").printed for law in LAWS}
    left = {law: printed[law]["steady_state_error"] for law in list(LAWS)[1:]}
    shares = " and ".join(f"{100 * left[law][0] / initial[0]:.0f} % ({LAWS[law]})" for law in left)
    heaves = "; ".join(
        f"{LAWS[law]}: {evidence.heave_for(law, 'lift', lift):.3g} and {evidence.heave_for(law, 'rotation', turn):.3g} "
        "m/s²"
        for law, (lift, turn) in left.items()
    )
    return [
        f"{MEASURES['response_time'].capitalize()}: the printed surface alone (δ = 0) takes {surface:.2f} s to 10 % of "
        f"the lift's initial error, so its printed {printed['variable_power_log']['response_time'][0]:.2f} s is "
        "measured in another way; group 1 prints 0.01 s for the same run.",
        f"{MEASURES['settling_time'].capitalize()}: the printed steady-state errors of the traditional laws are "
        f"{shares} of the lift's initial error, so their printed times are to bands wider than any usual one; they are "
        "not published.",
        f"{MEASURES['overshoot'].capitalize()}: what overshoots is a motor that cannot brake in time. Here the law's "
        "acceleration is limited and no motor is; the paper states neither limit.",
        f"{MEASURES['steady_state_error'].capitalize()}: it follows from the heave, which is not published, and no "
        f"heave gives both printed columns: at rest the lift's and the rotation's take, {heaves}.",
    ]


def _time(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.3f}"


def _printed(case: Case, measure: str, i: int) -> str:
    """A number of Table 4; times as they are printed, with two decimals."""
    if not case.printed:
        return "n/a"
    value = case.printed[measure][i]
    return f"{value:.2f}" if measure in TIMES else number(value)


def _claims(findings: Iterable[Finding]) -> list[Block]:
    blocks: list[Block] = [
        Heading("Claims"),
        _prose("""A claim's verdict follows from its checks: all met, it [[holds]]; some, [[partly]]; none, it
        [[fails]]. “Change” is what halving the step adds."""),
    ]
    for finding in findings:
        marks = []
        for check in finding.checks:
            why = f". **Not met:** {check.why}." if check.why and not check.met else ""
            marks.append(f"{'✓' if check.met else '✗'} {check.text}{why}")
        printed = any(n.printed is not None for n in finding.numbers)
        rows = []
        for n in finding.numbers:
            paper = [number(n.printed) if n.printed is not None else ""] if printed else []
            rows.append((n.label, n.unit, *paper, number(n.value, 4), change(n.change, n.value)))
        blocks += [
            Heading(f"Claim {finding.number} [[{finding.verdict}]]", 3),
            Text(finding.claim),
            Bullets(marks, marked=True),
            *([Text(f"{finding.note}.")] if finding.note else []),
            Table(["number", "unit", *(["paper"] if printed else []), "ours", "change"], rows, labels=2),
        ]
    return blocks


def _theory(study: Study) -> list[Block]:
    # Cases that are the same run under another name are listed once.
    distinct: dict[int, tuple[Case, Measured, Proof]] = {}
    for case in cases(study.groups):
        run, theory = study.evidence.runs[case.scenario], study.evidence.theory.get(case.scenario)
        if theory is not None:
            distinct.setdefault(id(run), (case, run, theory))
    rows = []
    for case, run, theory in distinct.values():
        for i, joint in enumerate(JOINTS):
            bounds, margin = theory.bounds, theory.margin
            values = (
                margin.per_joint[i],
                margin.bound,
                margin.c1,
                theory.disturbed.per_joint[i],
                theory.residual[i],
                theory.remaining[i],
                bounds.sliding[i],
                bounds.reaching,
                bounds.total[i],
                run.metric("settling_time", joint),
            )
            rows.append((f"{case.group}", case.name, joint, *map(number, values)))
    columns = ["group", "case", "joint", "largest |H⁻¹S|", "S̄0", "k1 − S̄0"]
    columns += ["largest |d|", "residual |σ|", "largest |σ|", "t_smax [s]", "t_q [s]", "t_a [s]", "settling time [s]"]
    caption = """d = σ̇ − law(σ) is the disturbance that the law meets, springs and a payload that the controller does
        not know included; its largest size is that after the first quarter of the run, that of σ is of the second half.
        “Residual |σ|”: below it the law asks for less than the largest |d|, so that |σ| need not become smaller. ∞: no
        bound."""
    gaps = {gap: sum(gap in theory.gaps for _, _, theory in distinct.values()) for gap in Gap}
    items = [f"{count} of {len(distinct)} runs: {gap.value}." for gap, count in gaps.items() if count]
    items += [
        f"With the boundary layer the tail of e decays at λ δ^(p/r − 1) = {theory.tail:.3g} 1/s."
        for _, _, theory in list(distinct.values())[:1]
    ]
    # Every case starts from the same state, and so from the same σ(0).
    start = [float(next(iter(study.evidence.runs.values()))[f"sigma_{joint}"][0]) for joint in JOINTS]
    zeta = float(next(iter(study.scenarios.values())).document["control"]["zeta"])
    promised = ", ".join(f"{reaching_time_bound(start, c1, zeta):.3g} s for c1 = {c1:g}" for c1 in (3.0, 2.0, 1.0))
    return [
        Heading("Theory against measurement"),
        _prose(f"""The sliding phase takes less than t_smax (Theorem 1), the reaching phase less than t_q if k1 exceeds
        the bound S̄0 on the acceleration H⁻¹S that the base oscillation asks for; t_a is their sum. S̄0 was measured
        along each run. t_q is {promised}: longer than the 4 s of a run, so a measured time below it proves little."""),
        Table(
            columns,
            rows,
            " ".join(caption.split()),
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
    readings = []
    for key, (run, half) in study.readings.items():
        values = [each.variation_rate("sigma_lift", 1.0) for each in (run, half)]
        values += [each.largest("e_lift", 0.25) for each in (run, half)]
        readings.append((READINGS[key].name, *map(number, values)))
    columns = ("", "settling time, lift / rotation [s]", "steady-state error, lift [m]", "half the step", "")
    literal_figure, readings_figure, decisions_figure = (_pictures(study, [figure], svg) for figure in OPEN_FIGURES)
    return [
        Heading("As printed"),
        _prose("""At t = 0 the printed law asks the lift for 3.5·10⁶ m/s², and the surface's term
        λ (p/r) ė |e|^(p/r − 1) has no bound where e passes 0. The paper states no limit. Taken literally, without and
        with a limit on the reaching law, base at rest:"""),
        Table(columns, _outcomes(study.literal, LITERAL), labels=1, words=(4,)),
        *literal_figure,
        _prose("""The logarithms of (18) are set with 1 + α and 1 − α beside them. Read as exponents, every term points
        at the surface, and the law's slope stays at 46 1/s or less up to |σ| = 1. Read as bases (with the sign of the
        last term that lets it point there too) the slope reaches 97 1/s near |σ| = 0.3, and where the shake takes σ
        there the springs enter a limit cycle. Shake 0.07 sin 11t, after 1 s:"""),
        Table(
            ("", "variation of σ, lift [m/s per s]", "half the step", "largest error, lift [m]", "half the step"),
            readings,
            labels=1,
        ),
        *readings_figure,
        Heading("What δ and a_max do"),
        _prose("""The boundary layer δ and the limit a_max on the reaching law are ours. They make the law one that
        springs and motors can follow. Base at rest:"""),
        Table(columns, _outcomes(study.layers, LAYERS), labels=1, words=(4,)),
        Table(columns, _outcomes(study.limits, LIMITS), labels=1, words=(4,)),
        *decisions_figure,
        Heading("Sampling and the solver's step"),
        _prose("""The paper does not say whether its control is sampled. Under shake, with control once in a period and
        held between:"""),
        Table(_SAMPLED, _sampled(study.sampling), labels=1, words=(3,)),
        _prose("""Without fast control the springs are not damped, and how long a run lasts depends on what hides that:
        RK4 at a step of a millisecond damps oscillations as fast as the springs', and motors with a limit push less
        hard. The paper shows its run to 3.6 s:"""),
        Table(
            ("", "lift off by 0.5 m [s]", "end of the run [s]", "half the step", ""),
            _lasting(study.solver),
            labels=1,
            words=(4,),
        ),
    ]


_SAMPLED = ("", "velocity of the lift above 10 Hz, RMS [m/s]", "half the step", "")


def _sampled(runs: Mapping[str, Twice]) -> list[tuple[str, ...]]:
    rows = []
    for key, (run, half) in runs.items():
        ripples = [each.ripple("dq1_lift", CHATTER_ABOVE) if each.status == "ok" else math.nan for each in (run, half)]
        ended = f"diverges at {number(run.end, 2)} s" if run.status != "ok" else ""
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


def _how_it_ended(run: Measured) -> str:
    """Why a run stopped, without the name of its status."""
    return run.message.partition(": ")[2] or run.message


def _what_happens(run: Measured) -> str:
    """In a word: divergence, chatter, or tracking."""
    if run.status != "ok":
        return f"diverges at {number(run.end, 2)} s"
    errors = [run.metric("steady_state_error", joint) / abs(float(run[f"e_{joint}"][0])) for joint in JOINTS]
    if max(errors) > 0.05:
        return "chatters beyond 5 % of the initial error"
    return "chatters" if max(errors) > 0.001 else "tracks"


def _ours(study: Study, step: float) -> list[Block]:
    any_scenario = next(iter(study.scenarios.values()))
    control, mechanism = any_scenario.document["control"], any_scenario.document["mechanism"]
    items = [
        f"J = {mechanism['J']:.4g} kg m² (m3 L3²/3: a slender rod, its centroid at L3), L1 = {mechanism['L1']:g} m.",
        f"Boundary layer δ = {control['delta']:g}, limit a_max = {_one(control['a_max'])}, no limit on U.",
        f"Solver: RK4 with a step of {number(step, 1)} s; continuous control; springs unloaded at the start.",
        "Thresholds of response and settling time, and every threshold of the claims.",
        "“Payload 1” and “payload 2” are +20 % and −20 % of the plant's m3 and J.",
    ]
    motions: dict[str, Case] = {}
    for case in cases(study.groups):
        motions.setdefault(_motion(study.scenarios[case.scenario]), case)
    items += [f"Base motion ({case.name} of group {case.group}): {motion}." for motion, case in motions.items()]
    return [Heading("What is ours"), Text("Not published, and chosen here:"), Bullets(items)]


def _one(value: Any) -> str:
    values = list(dict.fromkeys(value)) if isinstance(value, list) else [value]
    return " / ".join(f"{v:g}" for v in values)


def _motion(scenario: Scenario) -> str:
    parts = []
    for coordinate in COORDINATES:
        terms = scenario.document["base_motion"].get(coordinate.key, [])  # another kind has no terms
        sines = " + ".join(f"{t['amplitude']:.4g} sin({t['omega']:g} t{_phase(t['phase'])})" for t in terms)
        if sines:
            parts.append(f"{coordinate.alias or coordinate.key} {sines} {coordinate.unit}")
    return "; ".join(parts) or "none"


def _phase(phase: float) -> str:
    return f" {phase:+.4g}" if phase else ""
