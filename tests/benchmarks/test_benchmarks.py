"""The benchmark measures what it says: every contender does the same work, and the table tells of one that does not."""

import ctypes
import importlib
import json
import math
import os
import platform
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from springline.benchmarks import (
    against,
    aims,
    command,
    compile_time,
    docs_results,
    harness,
    math_speed,
    problem,
    roofline,
    same_bits,
    work_precision,
)
from springline.benchmarks import report as bench
from springline.benchmarks.compile_time import compile_times
from springline.benchmarks.contenders import CONTENDERS, handwritten_c, ours
from springline.codegen.kernel import LoopSettings, kernel, toolchain
from springline.model.system import System
from springline.runner import load_scenario
from springline.runner.files import InputError

TINY = harness.Effort(
    rounds=1, sample=1e-3, adaptive=problem.QUANTUM, compared=problem.QUANTUM, comparison=1e-3, compilers=False
)

# One of each build; of springline's own those that are not covered by the tests of equal bits.
AGREEING = {
    repr(contender.build): contender
    for contender in CONTENDERS
    if contender.comparable and "W =" not in contender.variant and "all tunable" not in contender.variant
}


def default(mode: problem.Control) -> problem.Contender:
    return next(contender for contender in CONTENDERS if ours.is_default(contender) and contender.control == mode)


@pytest.mark.parametrize("contender", AGREEING.values(), ids=lambda contender: contender.title)
def test_a_contender_does_the_same_work(contender: problem.Contender) -> None:
    for module in contender.modules:
        pytest.importorskip(module, reason=f"{module} is not installed: pip install 'springline[bench]'")
    delta = np.array([0.04, 0.05, 0.06])
    final = contender.build()(delta, problem.QUANTUM)
    expected = ours.reference(contender.control)(delta, problem.QUANTUM)
    assert final.shape == (3, 8)
    assert np.all(np.abs(final - expected) <= contender.tolerance * np.maximum(1.0, np.abs(expected)))
    # The three runs differ by far more than the tolerance, so one that ignored delta would be noticed.
    assert np.max(np.abs(expected[0] - expected[2])) > 2e-2
    assert np.all(np.array([sys.float_info.min]) * 0.5 > 0.0), "it makes the process flush denormal numbers to zero"


def test_contenders_are_told_apart() -> None:
    assert sum(map(ours.is_default, CONTENDERS)) == len(problem.MODES)
    titles = [contender.title for contender in CONTENDERS]
    assert len(titles) == len(set(titles))
    heads = {contender.variant.partition(",")[0] for contender in CONTENDERS if contender.comparable}
    assert heads == set(problem.MODES)
    assert all(contender.variant.startswith(contender.control) for contender in CONTENDERS if contender.comparable)


def test_ratios_refer_to_springlines_default_of_the_same_mode() -> None:
    chosen = [default(mode) for mode in problem.MODES] + [handwritten_c.CONTENDERS[0]]
    shares: list[float] = []
    report = harness.measure(TINY, chosen, shares.append)
    first, second, other = report.rows
    assert report.agreed
    assert (first.ratio, second.ratio) == (1.0, 1.0)
    assert other.ratio == other.ns_per_eval / first.ns_per_eval
    assert first.difference == 0.0 < other.difference < other.tolerance
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert report.machine["peak_gflops"] > 0.0
    assert bench.machine_lines(report)


def test_a_wrong_result_is_told() -> None:
    def wrong(delta: problem.Floats, steps: int) -> problem.Floats:
        return ours.reference("continuous")(delta, steps) * (1.0 + 1e-6)

    cheat = problem.Contender("cheat", "continuous", "continuous", lambda: wrong)
    report = harness.measure(TINY, [default("continuous"), cheat])
    assert not report.agreed
    assert report.rows[1].note == "result differs from springline's"


def test_a_result_that_is_no_number_is_wrong_too() -> None:
    broken = problem.Contender(
        "broken", "continuous", "continuous", lambda: lambda delta, steps: np.full((delta.size, 8), np.nan)
    )
    assert not harness.measure(TINY, [default("continuous"), broken]).agreed


def test_the_plant_of_an_arm_is_timed_without_its_law(monkeypatch: pytest.MonkeyPatch) -> None:
    plant = next(contender for contender in CONTENDERS if contender.variant == ours.PLANT)
    alone = replace(plant, variant=f"{ours.PLANT}, again")
    report = harness.measure(TINY, [default("continuous"), default("sampled"), plant, alone])
    assert report.agreed
    *_, first, second = report.rows
    assert (first.ratio, second.ratio) == (1.0, second.ns_per_eval / first.ns_per_eval)
    assert (first.compared, bench.table([first])[0][5]) == (0, "–")
    # The command is that of the first sample, whatever the law has since become.
    delta = np.array([0.04, 0.06])
    held = plant.build()(delta, problem.QUANTUM)
    controlled = ours.reference("sampled")(delta, problem.QUANTUM)
    assert np.max(np.abs(held - controlled)) > 1e-2
    np.testing.assert_array_equal(
        held, ours.build(ours.DEFAULT["sampled"], hold=problem.QUANTUM)(delta, problem.QUANTUM)
    )
    monkeypatch.setattr(ours, "LoopSettings", lambda *found, **more: LoopSettings(*found, bound=0.1, **more))
    with pytest.raises(RuntimeError, match="out_of_bounds: its time says nothing"):
        plant.build()(delta, problem.QUANTUM)


def test_arms_of_which_the_plant_is_timed_have_numbers_of_their_own() -> None:
    assert {variant: System(arm).n for variant, arm in ours.PLANTS.items()} == {ours.PLANT: 2, ours.SEVEN: 7}
    for arm in ours.PLANTS.values():
        assert arm.base_motion == ours.STRUCTURE.base_motion
        found = ours.values(arm)
        assert found["base_motion.heave.0.amplitude"] == problem.SHAKE_AMPLITUDE
    assert found["mechanism.mass.6"] > 0.0


def test_a_missing_package_is_told_and_does_no_harm() -> None:
    absent = replace(handwritten_c.CONTENDERS[0], modules=("no_such_package",))
    report = harness.measure(TINY, [default("continuous"), absent])
    assert report.agreed
    assert math.isnan(report.rows[1].ns_per_eval)
    assert "no_such_package" in report.rows[1].note
    assert "springline[bench]" in report.rows[1].note


def test_of_several_batch_sizes_the_fastest_is_shown() -> None:
    slow, fast = (harness.Row("JAX", "continuous", ns, batch=batch) for ns, batch in ((400.0, 64), (300.0, 1024)))
    other = harness.Row("JAX", "sampled", 200.0)
    assert harness.fastest([slow, fast, other]) == [fast, other]


def test_compilers_are_timed_cold_and_cached() -> None:
    cold, cached = compile_times(handwritten_c.CONTENDERS[0])
    assert cold > cached >= 0.0


def test_what_an_arm_takes_is_timed_step_by_step(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = {**compile_time.ARMS[compile_time.BARRED], "mechanism.n": 1}
    monkeypatch.setenv("SPRINGLINE_CACHE", str(tmp_path))
    monkeypatch.setitem(compile_time.ARMS, compile_time.BARRED, one)
    found = compile_time.measure_arm(compile_time.BARRED)
    assert all(seconds > 0.0 for seconds in found[1:])
    for seconds, expected in ((3.0, 0), (4.0, 1)):
        row = compile_time.Waiting(found.operations, seconds, seconds, seconds, seconds)
        monkeypatch.setattr(compile_time, "waiting", lambda arm, row=row: row)
        assert compile_time.main([]) == expected
        assert f"{found.operations:,}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arm", "row"),
    [
        ("planar_arm, n = 7", "`planar_arm`, `n = 7`"),
        ("spatial arm, 7 joints", "seven revolute joints in space, every"),
    ],
)
def test_the_documents_have_the_operations_of_the_arms_that_are_timed(arm: str, row: str) -> None:
    page = (Path(__file__).parents[2] / "docs" / "own-arm.md").read_text("utf-8")
    [shown] = re.findall(rf"^\| {re.escape(row)}.*\| ([\d,]+) \|$", page, re.MULTILINE)
    system = load_scenario("paper/nominal", compile_time.ARMS[arm]).system()
    assert f"{compile_time.operations_of_plant(system):,}" == shown


@pytest.mark.skipif(platform.machine() != "x86_64", reason="operations are counted in x86-64 machine code")
def test_operations_are_counted_in_the_machine_code(require_tool: Callable[..., str]) -> None:
    require_tool("objdump", "it comes with gcc, in binutils")
    counts = [
        roofline.flops_per_evaluation(
            kernel(replace(ours.DEFAULT["continuous"], options=replace(roofline.EVALUATIONS, width=width, groups=2)))
        )
        for width in (2, 4)
    ]
    # The equations alone take about 250, the elementary functions as much again; the count belongs to one run,
    # however many are in a vector.
    assert all(300 < count < 1000 for count in counts)
    assert counts[0] == pytest.approx(counts[1], rel=0.1)


def test_elementary_functions_are_timed_each_by_itself() -> None:
    times = math_speed.measure(samples=2)
    assert {"exp", "sincos", "pow"} <= times.keys()
    assert all(0.0 < ns < 1000.0 for row in times.values() for ns in row.values())
    # The law, its surface and the arm, for two joints; nothing else of them needs a fast path.
    assert math_speed.calls(times) == {"exp": 2, "log": 2, "log1p": 2, "pow_m1_3": 2, "pow_p1_2": 2, "sincos": 1}


def test_the_command_writes_rows_a_chart_and_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(harness, "QUICK", TINY)
    command.bench(output=tmp_path / "bench", quick=True, only="handwritten", as_json=True)
    answer = json.loads(capsys.readouterr().out)
    assert (answer["command"], answer["status"]) == ("bench", "ok")
    assert {"contender", "variant", "ns_per_eval", "ratio"} <= answer["rows"][0].keys()
    assert {row["contender"].partition(",")[0] for row in answer["rows"]} == {"springline", "handwritten C"}
    assert answer["units"]["ns_per_eval"] == "ns"
    assert {path.name for path in (tmp_path / "bench").iterdir()} == set(bench.OUTPUTS)
    kept = json.loads((tmp_path / "bench" / "bench.json").read_text())
    assert kept["rows"] == answer["rows"]
    assert kept["aims"] == answer["aims"]
    assert [one["aim"] for one in kept["aims"]] == [aim.name for aim in aims.AIMS]
    by_name = {one["aim"]: one for one in kept["aims"]}
    assert by_name["continuous: handwritten C"]["measured"] > 0.0
    assert by_name["continuous: JAX"]["verdict"] == "not measured: not among the contenders"
    assert kept["machine"]["versions"]["casadi"]


MACHINE = {"instruction_set": "x86-64-v3", "free_cores": 2.0}


def judged(longer: float, shorter: float, aim: aims.Aim, **machine: object) -> aims.Judgement:
    rows = [harness.Row(*line, ns) for line, ns in ((aim.longer, longer), (aim.shorter, shorter)) if not math.isnan(ns)]
    [found] = aims.judge(harness.Report(rows, MACHINE | machine), [aim])
    return found


def test_an_aim_is_reached_or_missed_as_the_instruction_set_has_it() -> None:
    aim = aims.Aim("a", ("them", "continuous"), ("us", "continuous"), (25.0, 10.0))
    for instructions, ns, expected in (
        ("x86-64-v3", 99.0, "missed"),
        ("x86-64-v3", 100.0, "reached"),
        ("x86-64-v4", 100.0, "missed"),
        ("x86-64-v4", 250.0, "reached"),
        ("neon", 250.0, "no aim for neon"),
        ("x86-64-v2", 250.0, "no aim for x86-64-v2"),
    ):
        found = judged(ns, 10.0, aim, instruction_set=instructions)
        assert (found.measured, found.verdict) == (ns / 10.0, expected)
    most = replace(aim, wanted=1.2, most=True)
    assert [judged(ns, 10.0, most).verdict for ns in (11.9, 12.1)] == ["reached", "missed"]
    assert judged(11.9, 10.0, most, instruction_set="neon").verdict == "reached"


def test_an_aim_whose_lines_or_cores_are_missing_says_so() -> None:
    aim = aims.Aim("a", ("them", "continuous"), ("us", "continuous"), 1.9)
    assert judged(math.nan, 1.0, aim).verdict == "not measured: not among the contenders"
    assert judged(math.nan, 1.0, replace(aim, how="--before CHECKOUT")).verdict == "not measured: --before CHECKOUT"
    absent = harness.Report(
        [harness.Row("them", "continuous", note="needs jax"), harness.Row("us", "continuous", 1.0)], MACHINE
    )
    assert aims.judge(absent, [aim])[0].verdict == "not measured: needs jax"
    threads = replace(aim, cores=2)
    assert judged(1.5, 1.0, threads, free_cores=1.3).verdict == "not judged: 1.30 cores were free"
    assert judged(1.95, 1.0, threads, free_cores=1.3).verdict == "reached"
    assert judged(1.5, 1.0, threads).verdict == "missed"


def test_every_aim_is_of_two_lines_that_the_benchmark_has() -> None:
    lines = {(contender.name, contender.variant) for contender in CONTENDERS}
    lines |= {(contender.name, contender.variant) for contender in against.contenders(Path(sys.executable))}
    if (os.cpu_count() or 1) == 1:
        lines |= {(ours.NAME, f"{mode}, 2 threads") for mode in problem.MODES}
    assert not [line for aim in aims.AIMS for line in (aim.longer, aim.shorter) if line not in lines]
    assert len({aim.name for aim in aims.AIMS}) == len(aims.AIMS)
    for column in aims.COLUMNS:
        assert all(aim.on(column) > 1.0 for aim in aims.AIMS)


@pytest.mark.skipif((os.cpu_count() or 1) == 1, reason="there is one processor core")
def test_threads_are_judged_by_the_cores_that_are_free() -> None:
    threads = next(contender for contender in CONTENDERS if contender.threads == 2)
    alone, both = (harness.measure(TINY, [default("continuous"), *more]) for more in ([], [threads]))
    assert alone.machine["free_cores"] is None
    assert both.machine["free_cores"] > 0.0


def test_the_instruction_set_goes_with_the_width_of_vectors() -> None:
    found = toolchain.native_instruction_set()
    wide = {"x86-64-v4": 8, "x86-64-v3": 4}.get(found)
    assert wide in (None, toolchain.native_vector_width())
    text = "\n".join(bench.machine_lines(harness.measure(TINY, [default("continuous")])))
    assert f", {found}, vectors of {toolchain.native_vector_width()} doubles" in text


def test_the_table_has_a_cell_for_every_column() -> None:
    rows = [harness.Row("a", "continuous", 12_345.6, 2.0, difference=3e-12), harness.Row("b", "sampled", note="absent")]
    lines = bench.table(rows)
    assert {len(line) for line in lines} == {len(bench.COLUMNS)}
    assert lines[0][2:6] == ["12,346", "2", "1,975", "3e-12"]
    assert lines[1][2:] == ["–", "–", "–", "–", "–", "–", "absent"]


def test_a_bit_that_differs_is_found_with_its_column_and_size() -> None:
    ours = pa.table({"t": [0.0, 1.0], "q1": [0.0, math.nan], "status": ["ok", "ok"], "new": [1.0, 2.0]})
    assert same_bits.difference(ours, ours.drop_columns("new")) == ""
    last = ours.set_column(1, "q1", [[math.ulp(0.0), math.nan]])
    assert same_bits.difference(ours, last).startswith("q1 from row 0 on (0.0, and 5e-324 in the other)")
    assert "q1" in same_bits.difference(ours, ours.set_column(1, "q1", [[-0.0, math.nan]]))
    assert "status" in same_bits.difference(ours, ours.set_column(2, "status", [["ok", "diverged"]]))
    assert "2 rows, and 1 in the other" in same_bits.difference(ours, ours.slice(0, 1))


def test_checkouts_that_differ_end_the_comparison_with_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    (tmp_path / ".venv" / "bin" / "python").touch()
    monkeypatch.setattr(sys, "argv", ["same_bits", str(tmp_path)])
    monkeypatch.setattr(same_bits, "packaged_scenarios", lambda: ("one",))
    for value, expected in ((1.0, 0), (1.5, 1)):

        def results(
            interpreter: Path, folder: Path, names: tuple[str, ...], theirs: Path = tmp_path, value: float = value
        ) -> None:
            for name in names:
                (folder / name).mkdir()
                table = pa.table({"q1": [value if interpreter.is_relative_to(theirs) else 1.0]})
                for file in ("trajectory", "metrics"):
                    pq.write_table(table, folder / name / f"{file}.parquet")

        monkeypatch.setattr(same_bits, "results", results)
        assert same_bits.main() == expected
    assert "q1 from row 0 on (1.0, and 1.5 in the other), by at most 0.5" in capsys.readouterr().out


def test_the_page_has_the_results_as_the_benchmark_prints_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (Path(__file__).parents[2] / "docs" / "performance.md").read_text("utf-8")
    _, _, rest = page.partition(f"<!-- {docs_results.NAME}: begin -->\n")
    shown, found, _ = rest.partition(f"<!-- {docs_results.NAME}: end -->\n")
    assert found
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in shown.splitlines() if line[:1] == "|"]
    split = lines.index(list(bench.AIM_COLUMNS))
    results, judgements = lines[2:split], lines[split + 2 :]
    assert lines[0] == list(bench.COLUMNS)
    assert {len(line) for line in results} == {len(bench.COLUMNS)}
    assert [line[0] for line in judgements] == [aim.name for aim in aims.AIMS]
    there = {(contender.name, contender.variant) for contender in CONTENDERS}
    there |= {(contender.name, contender.variant) for contender in against.contenders(Path(sys.executable))}
    shown_lines = {(line[0], line[1]) for line in results}
    several = re.compile(" threads$")  # as many as the machine has cores
    assert {line for line in shown_lines ^ there if not several.search(line[1])} == set()
    assert {(ours.NAME, f"{mode}, 2 threads") for mode in problem.MODES} <= shown_lines
    assert all(re.search("^(reached|missed|not judged: .*)$", line[3]) for line in judgements)

    readme = (Path(__file__).parents[2] / "README.md").read_text("utf-8")
    assert docs_results.short(shown) in readme
    copies = [tmp_path / "performance.md", tmp_path / "README.md"]
    anew = shown.replace("| handwritten C | continuous |", "| handwritten C | continuous | 1", 1)
    (tmp_path / "bench.md").write_text(anew, encoding="utf-8")
    monkeypatch.setattr(docs_results, "PAGE", tmp_path / "nowhere.md")
    monkeypatch.setattr(sys, "argv", ["docs_results", str(tmp_path)])
    with pytest.raises(SystemExit):
        docs_results.main()
    assert "run it in a checkout" in capsys.readouterr().err
    for name, copy, text in zip(("PAGE", "README"), copies, (page, readme), strict=True):
        monkeypatch.setattr(docs_results, name, copy)
        copy.write_text(text, encoding="utf-8")
    docs_results.main()
    assert copies[0].read_text("utf-8") == page.replace(shown, anew)
    assert copies[1].read_text("utf-8") == readme.replace(docs_results.short(shown), docs_results.short(anew))
    assert docs_results.short(shown) != docs_results.short(anew)
    monkeypatch.setattr(sys, "argv", ["docs_results", str(tmp_path / "absent")])
    with pytest.raises(SystemExit):
        docs_results.main()
    assert "run `springline bench` first" in capsys.readouterr().err


def checkout(folder: Path) -> Path:
    """A folder that looks like a checkout: it has the springline of these tests."""
    python = folder / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    return folder


def test_two_checkouts_are_timed_in_one_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = ["against", str(checkout(tmp_path)), "--rounds", "2", "--sample", "1e-3", "--threshold", "1e3"]
    monkeypatch.setattr(sys, "argv", argv)
    assert against.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + len(against.WORK)
    assert all(len(line) <= 80 for line in lines)
    assert all(float(line.split()[-1]) > 0.0 for line in lines[1:])


def test_the_kernels_of_another_checkout_are_contenders(tmp_path: Path) -> None:
    before = against.contenders(against.interpreter_of(checkout(tmp_path)))
    report = harness.measure(TINY, [default("continuous"), default("sampled"), *before])
    assert report.agreed
    assert [(row.contender, row.variant, row.difference) for row in report.rows[2:]] == [
        (against.NAME, mode, 0.0) for mode in problem.MODES
    ]
    for broken, told in ((tmp_path / "absent", "run `make install`"), (checkout(tmp_path / "empty"), "cannot import")):
        if broken.exists():
            (broken / ".venv" / "bin" / "python").write_text("#!/bin/sh\nexit 1\n")
        with pytest.raises(InputError, match=told):
            command.bench(output=tmp_path / "out", before=broken)


def test_the_packages_of_another_checkout_are_its_own_and_ours_come_back(tmp_path: Path) -> None:
    with against.packages_of(checkout(tmp_path) / ".venv" / "bin" / "python"):
        theirs = importlib.import_module("springline.benchmarks.problem")
        assert theirs is not problem
    assert importlib.import_module("springline.benchmarks.problem") is problem


def test_a_kernel_that_is_slower_by_both_ratios_ends_with_1(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = against.Timed(lambda delta, steps: delta, 1, against.Clock(ctypes.CDLL(None)))
    race = against.Race((kernel, kernel), samples=([3.0, 2.2, 2.4], [2.0, 2.0, 2.0]))
    assert race.best == (2.2, 2.0)
    assert race.ratios == (1.1, 1.2)
    monkeypatch.setattr(against, "race", lambda *_: {"continuous": race})
    for threshold, expected in (("1.09", 1), ("1.15", 0), ("1.25", 0)):
        monkeypatch.setattr(sys, "argv", ["against", str(checkout(tmp_path / threshold)), "--threshold", threshold])
        assert against.main() == expected


def test_a_checkout_without_a_scenario_is_no_difference(tmp_path: Path) -> None:
    for folder in ("ours", "theirs"):
        (tmp_path / folder).mkdir()
    text, equal = same_bits.compared(tmp_path / "ours", tmp_path / "theirs", "paper/nominal")
    assert equal and "does not have it" in text


def test_one_step_a_sample_of_high_order_beats_ten_of_rk4() -> None:
    exact = work_precision.ours(*work_precision.REFERENCE)
    high, low = (np.max(np.abs(work_precision.ours(*chosen) - exact)) for chosen in (("dop853", 1), ("rk4", 10)))
    assert 0.0 < high < low < 1e-8


def test_scipy_runs_the_same_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work_precision, "DURATION", 0.02)
    q1, count = work_precision.scipys("DOP853", 1e-10)
    assert q1.shape == (21, 2) and count > 12 * 20
    assert np.max(np.abs(q1 - work_precision.ours(*work_precision.REFERENCE))) < 1e-12
