"""Sweep files: every mistake is named, and every run's numbers follow from sweep, seed and index alone."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special, stats

from springline.runner import simulate
from springline.runner.files import InputError
from springline.runner.scenario import packaged_sweeps
from springline.runner.sweep import Plan, load_sweep, open_pool, sampling
from springline.runner.sweep.plan import MOST_GROUPS
from springline.runner.sweep.sweep_file import sweep_from_json

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """A sweep file with the given text: what varies, and lines above it."""

    def make(vary: str, head: str = "samples = 100", scenario: str = "paper/nominal") -> Path:
        file = tmp_path / "sweep.toml"
        file.write_text(f'scenario = "{scenario}"\n{head}\n[vary]\n{vary}\n', encoding="utf-8")
        return file

    return make


def plan_of(file: Path, chunk: int = 0) -> Plan:
    return Plan(load_sweep(file), chunk)


def everything(plan: Plan, key: str) -> np.ndarray:
    return np.concatenate([plan.columns(plan.chunk(k))[key] for k in range(plan.chunks)])


# --- sequences -------------------------------------------------------------------------------------------


@given(first=st.integers(0, 10**6), count=st.integers(1, 50), cut=st.integers(0, 50), seed=st.integers(0, 2**64 - 1))
def test_sequences_do_not_depend_on_how_they_are_cut(first: int, count: int, cut: int, seed: int) -> None:
    cut = min(cut, count)
    total = 10**6 + 50
    for draw in (
        lambda a, n: sampling.random(seed, "k", a, n),
        lambda a, n: sampling.latin_hypercube(seed, "k", a, n, total),
    ):
        whole = draw(first, count)
        assert np.array_equal(whole, np.concatenate([draw(first, cut), draw(first + cut, count - cut)]))
        assert ((whole > 0) & (whole < 1)).all()


@given(samples=st.integers(1, 3000), seed=st.integers(0, 100))
def test_latin_hypercube_has_one_entry_in_each_stratum(samples: int, seed: int) -> None:
    column = sampling.latin_hypercube(seed, "key", 0, samples, samples)
    assert np.array_equal(np.sort(np.floor(column * samples)), np.arange(samples))


def test_latin_hypercube_columns_are_shuffled_independently() -> None:
    columns = [sampling.latin_hypercube(1, name, 0, 4096, 4096) for name in "abcd"]
    correlation = np.corrcoef([*columns, np.arange(4096)])
    assert np.abs(correlation - np.eye(5)).max() < 5 / np.sqrt(4096)


def test_random_numbers_are_uniform_and_independent_of_the_name() -> None:
    a, b = (sampling.random(0, name, 0, 100_000) for name in "ab")
    assert stats.kstest(a, "uniform").pvalue > 1e-4
    assert abs(np.corrcoef(a, b)[0, 1]) < 5 / np.sqrt(len(a))


def test_sobol_is_a_net_and_starts_anywhere() -> None:
    """Of 2^10 points each elementary interval of area 2^-10 holds one: the digital shift keeps the net."""
    points = sampling.Sobol(7, ("a", "b")).rows(0, 1024)
    for k in range(11):
        cells = np.floor(points * [2**k, 2 ** (10 - k)]).astype(int)
        assert len(np.unique(cells, axis=0)) == 1024
    sequence = sampling.Sobol(7, ("a", "b"))
    for first in (900, 0, 17, 400):
        assert np.array_equal(sequence.rows(first, 100), points[first : first + 100])


def test_the_sampler_draws_what_its_version_says() -> None:
    """From Philox4x64-10, SplitMix64 in a Feistel network, and Joe and Kuo's numbers, each in plain integers.

    A release in which one of these differs has another sampling.VERSION: it must not continue a dataset of this one.
    """
    assert sampling.VERSION == 1
    random = {0: "0x1.bcb24808a7b46p-2", 1: "0x1.a1e7edc47030ap-2", 4: "0x1.af4a4da54af1ap-2"}
    random[1_000_003] = "0x1.6491d0b80938dp-1"
    assert {i: float(sampling.random(11, "control.k1", i, 1)[0]).hex() for i in random} == random
    key = sampling._key(5, "a")
    assert sampling._permuted(np.arange(10, dtype=np.uint64), 10, key).tolist() == [6, 9, 8, 1, 2, 7, 5, 4, 0, 3]
    some = np.array([0, 1, 999_999], dtype=np.uint64)
    assert sampling._permuted(some, 1_000_003, key).tolist() == [77_048, 736_779, 924_334]
    column = [float(x).hex() for x in sampling.latin_hypercube(5, "a", 0, 3, 10)]
    assert column == ["0x1.41a5b5eaf5320p-1", "0x1.d0b0ef085f153p-1", "0x1.a94338b654d1dp-1"]
    points = {
        0: ["0x1.702d675600000p-2", "0x1.23b8575700000p-1"],
        1: ["0x1.b816b3ab00000p-1", "0x1.1dc2bab800000p-4"],
        77: ["0x1.1416b3ab00000p-1", "0x1.1f70aeae00000p-2"],
        123_456: ["0x1.6b0f675600000p-2", "0x1.7e29575700000p-1"],
    }
    sequence = sampling.Sobol(3, ("control.k1", "control.delta"))
    assert {i: [float(x).hex() for x in sequence.rows(i, 1)[0]] for i in points} == points
    spreads = {
        sampling.uniform: (-1.5, 4.0, "-0x1.7fffffffffffdp+0 0x1.3333333333330p-3 0x1.eae147ae147aep+1"),
        sampling.log_uniform: (0.02, 0.1, "0x1.47ae147ae147cp-6 0x1.098743b3bd2a7p-5 0x1.864b0717e0638p-4"),
        sampling.normal: (1.0, 0.05, "0x1.2dd5fbdf5aaf2p-1 0x1.f29349eeca94dp-1 0x1.1812fc07e0743p+0"),
    }
    for spread, (first, second, numbers) in spreads.items():
        drawn = spread(np.array([2.0**-53, 0.3, 0.97]), first, second)
        assert " ".join(float(x).hex() for x in drawn) == numbers


@pytest.mark.parametrize(("low", "high"), [(98.08, 99.72), (41.4, 61.42), (27.72, 29.41)])
def test_rounding_leads_no_number_out_of_a_logarithmic_range(low: float, high: float) -> None:
    """Ranges at whose end low exp(u ln(high/low)) rounds to more than high."""
    last = np.array([1 - 2.0**-53])
    assert low * np.exp(last * np.log(high / low)) >= high
    assert sampling.log_uniform(last, low, high)[0] == high


def test_distributions_are_the_textbook_ones() -> None:
    """Against SciPy to a few ulp; the ends of a range are never left."""
    u = np.concatenate([sampling.random(3, "u", 0, 20_000), [2.0**-53, 1e-12, 0.075, 0.5, 0.925, 1 - 2.0**-53]])
    assert np.allclose(sampling.normal(u, 2.0, 0.5), 2.0 + 0.5 * special.ndtri(u), rtol=1e-14, atol=1e-15)
    drawn = sampling.log_uniform(u, 1e-3, 20.0)
    assert np.allclose(drawn, 1e-3 * 2e4**u, rtol=1e-14)
    assert drawn.min() >= 1e-3
    assert drawn.max() <= 20.0
    assert np.array_equal(np.bincount(sampling.chosen(np.linspace(0.05, 0.95, 10), 5)), [2] * 5)


# --- runs ------------------------------------------------------------------------------------------------

VARIED = """
control.delta = { log_uniform = [0.01, 0.1] }
control.a_max.0 = { uniform = [50, 500] }
control.a_max.1 = { tie = "control.a_max.0", factor = 2 }
plant.m3.scale = { normal = [1.0, 0.05] }
plant.J.scale = { tie = "plant.m3.scale" }
control.k1 = { values = [1.0, 2.0, 3.0] }
control.k2 = { tie = "control.k1", values = [10.0, 20.0, 30.0] }
"""


@pytest.mark.parametrize("method", ["random", "sobol", "latin_hypercube"])
def test_rows_do_not_depend_on_the_chunk(write: Write, method: str) -> None:
    file = write(VARIED, f'samples = 500\nmethod = "{method}"\nseed = 5')
    plans = [plan_of(file, chunk) for chunk in (32, 64, 500)]
    for key in plans[0].columns(plans[0].chunk(0)):
        columns = [everything(plan, key) for plan in plans]
        assert len(columns[0]) == 500
        assert all(np.array_equal(columns[0], other) for other in columns[1:])


def test_a_column_does_not_depend_on_what_else_varies(write: Write) -> None:
    alone = everything(plan_of(write("control.k1 = { uniform = [1, 2] }")), "control.k1")
    beside = everything(
        plan_of(write("control.k3 = { uniform = [5, 6] }\ncontrol.k1 = { uniform = [1, 2] }")), "control.k1"
    )
    assert np.array_equal(alone, beside)


def test_tied_keys_move_together(write: Write) -> None:
    plan = plan_of(write(VARIED))
    assert np.array_equal(everything(plan, "control.a_max.1"), 2 * everything(plan, "control.a_max.0"))
    assert np.array_equal(everything(plan, "plant.J.scale"), everything(plan, "plant.m3.scale"))
    assert np.array_equal(everything(plan, "control.k2"), 10 * everything(plan, "control.k1"))


def test_only_what_varies_is_tunable(write: Write) -> None:
    work = plan_of(write(VARIED)).groups[0].work
    assert set(work.spec.tunable) == {
        "plant.m3", "plant.J", "control.delta", "control.a_max.0", "control.a_max.1", "control.k1", "control.k2"
    }  # fmt: skip


def test_a_nominal_parameter_moves_the_plant_with_it(write: Write) -> None:
    work = plan_of(write("mechanism.m3 = { uniform = [30, 50] }")).groups[0].work
    assert set(work.spec.tunable) == {"mechanism.m3", "plant.m3"}


def test_scenario_of_a_run_has_the_numbers_of_its_row(write: Write) -> None:
    plan = plan_of(write(VARIED + 'control.law = { each = ["power", "double_power"] }\n'))
    assert plan.runs == 200
    for run in (0, 99, 100, 199):
        chunk = plan.chunk_of(run)
        scenario, work = plan.scenario_of(run), chunk.group.work
        keys = [slot.key for slot in work.system.slots]
        row = plan.inputs(chunk, plan.columns(chunk)).parameters[run - chunk.first]
        assert np.array_equal(scenario.values()[[keys.index(key) for key in work.parameters]], row)
        assert scenario.structure().law == ("power" if run < 100 else "double_power")
    with pytest.raises(IndexError):
        plan.scenario_of(200)


def test_a_grid_is_the_product_of_its_axes_the_last_the_fastest(write: Write) -> None:
    vary = """
    control.k1 = { uniform = [1.0, 2.0], points = 3 }
    control.delta = { log_uniform = [0.01, 1.0], points = 3 }
    control.fast = { values = [true, false] }
    control.a_max = { values = [100.0, inf] }
    """
    plan = plan_of(write(vary, 'method = "grid"'))
    assert plan.runs == 36
    assert [group.runs for group in plan.groups] == [18, 18]
    assert list(everything(plan, "control.fast")) == [True] * 18 + [False] * 18
    assert np.array_equal(everything(plan, "control.k1")[:18], np.repeat([1.0, 1.5, 2.0], 6))
    assert np.allclose(everything(plan, "control.delta")[:6], np.repeat([0.01, 0.1, 1.0], 2), rtol=1e-15)
    assert everything(plan, "control.delta")[4] == 1.0
    assert np.array_equal(everything(plan, "control.a_max")[:4], [100.0, np.inf] * 2)


def test_values_share_the_samples_and_each_repeats_them(write: Write) -> None:
    vary = """
    control.k1 = { uniform = [1, 2] }
    control.fast = { values = [true, false, true] }
    control.law = { each = ["power", "double_power"] }
    """
    with pytest.raises(InputError, match="at most"):
        plan_of(write(vary.replace('["power", "double_power"]', str([0.1 * i for i in range(MOST_GROUPS)]))))
    plan = plan_of(write(vary, "samples = 100"))
    assert plan.runs == 200
    assert [group.runs for group in plan.groups] == [33, 33, 34] * 2
    k1 = everything(plan, "control.k1")
    assert np.array_equal(k1[:100], k1[100:])
    assert len(np.unique(k1)) == 100


def test_structural_and_timing_keys_group_and_chunks_stay_inside_groups(write: Write) -> None:
    vary = """
    simulation.duration = { each = [0.001, 0.002] }
    control.k1 = { tie = "simulation.duration", values = [1.0, 2.0] }
    control.l = { values = [3, 5] }
    control.delta = { uniform = [0.01, 0.1] }
    """
    plan = plan_of(write(vary, "samples = 100\nchunk = 64"))
    assert [group.work.settings.steps for group in plan.groups] == [10, 10, 20, 20]
    assert [group.constants["control.k1"] for group in plan.groups] == [1.0, 1.0, 2.0, 2.0]
    covered = []
    for k in range(plan.chunks):
        chunk = plan.chunk(k)
        assert chunk.group.first <= chunk.first
        assert chunk.first + chunk.runs <= chunk.group.first + chunk.group.runs
        covered += range(chunk.first, chunk.first + chunk.runs)
        assert all(plan.chunk_of(run).number == k for run in (chunk.first, chunk.first + chunk.runs - 1))
    assert covered == list(range(plan.runs))
    assert plan.schema.field("control.l").type == "int64"


def test_chunks_are_whole_packs_and_small_enough(write: Write) -> None:
    for samples in (1, 100, 10_000, 1_000_000):
        plan = plan_of(write("control.k1 = { uniform = [1, 2] }", f"samples = {samples}"))
        assert plan.chunk_size % 32 == 0
        assert plan.chunk_size <= 4096
        assert sum(plan.chunk(k).runs for k in range(plan.chunks)) == samples


def test_axes_survive_their_description(write: Write) -> None:
    sweep = load_sweep(write(VARIED + "control.U_max = { values = [inf, 100.0] }\n"))
    assert sweep_from_json(sweep.as_json(), sweep.chunk or 32, sweep.scenario, sweep.source).axes == sweep.axes


def test_nested_tables_and_quoted_keys_mean_the_same(tmp_path: Path) -> None:
    texts = (
        "[vary]\ncontrol.k1 = { uniform = [1, 2] }\ncontrol.a_max.0 = { uniform = [1, 2] }",
        '[vary]\n"control.k1" = { uniform = [1, 2] }\n"control.a_max.0" = { uniform = [1, 2] }',
        "[vary.control]\nk1 = { uniform = [1, 2] }\na_max.0.uniform = [1, 2]",
    )
    found = []
    for text in texts:
        file = tmp_path / "sweep.toml"
        file.write_text(f"samples = 3\n{text}\n", encoding="utf-8")
        found.append(load_sweep(file).axes)
    assert found[0] == found[1] == found[2]


def test_a_scenario_beside_the_sweep_is_found(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("[simulation]\nduration = 0.5\n", encoding="utf-8")
    file = tmp_path / "sweep.toml"
    file.write_text(
        'scenario = "mine.toml"\nsamples = 1\n'
        "[set]\nsimulation.step = 0.5e-3\n[vary]\ncontrol.k1 = { uniform = [1, 2] }",
        encoding="utf-8",
    )
    assert load_sweep(file).scenario.steps == 1000


@pytest.mark.parametrize("name", packaged_sweeps())
def test_packaged_sweeps_are_valid(name: str) -> None:
    plan = Plan(load_sweep(name))
    assert plan.runs > 150
    assert plan.columns(plan.chunk(plan.chunks - 1))


def test_the_packaged_sweeps_are_those_of_the_documentation() -> None:
    assert packaged_sweeps() == (
        "controllers",
        "delay_and_period",
        "encoder_bits",
        "gains",
        "laws",
        "payload_and_friction",
        "payload_and_phase",
        "stability_map",
    )


def test_what_a_sweep_over_laws_sets_is_set(tmp_path: Path) -> None:
    """A law has no table of its own; once every key outside [control] was held back for those that have none."""
    file = tmp_path / "laws.toml"
    file.write_text(
        "samples = 1\n[set]\nsimulation.duration = 0.5\nmechanism.m3 = 30.0\ncontrol.delta = 0.07\n"
        '[vary]\ncontrol.law = { each = ["power", "double_power"] }\ncontrol.observer = { values = ["none"] }\n',
        encoding="utf-8",
    )
    sweep = load_sweep(file)
    assert not sweep.held
    document = sweep.scenario.document
    assert document["simulation"]["duration"] == 0.5
    assert document["mechanism"]["m3"] == 30.0
    assert document["control"]["delta"] == 0.07


# --- mistakes --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("vary", "head", "message"),
    [
        ("control.delt = { uniform = [1, 2] }", "samples = 9", r"vary\.control\.delt: unknown key.*control\.delta"),
        ("control.delt = { values = [1] }", "samples = 9", r"control\.delt"),
        ("control.delta = { uniform = [2, 1] }", "samples = 9", r"control\.delta\.uniform: the range is empty"),
        ("control.delta = { uniform = [1, 1] }", "samples = 9", "the range is empty"),
        ("control.delta = { uniform = [1, inf] }", "samples = 9", "two finite numbers"),
        ("control.delta = { log_uniform = [0, 1] }", "samples = 9", "cannot reach zero"),
        ("control.delta = { log_uniform = [-1, 1] }", "samples = 9", "cannot reach zero"),
        ("control.delta = { normal = [0, 0] }", "samples = 9", "standard deviation > 0"),
        ("control.delta = { unifrom = [0, 1] }", "samples = 9", "unknown word.*'uniform'"),
        ("control.delta = { uniform = [0, 1], values = [1] }", "samples = 9", "exactly one of"),
        ("control.delta = [0, 1]", "samples = 9", "expected a table such as"),
        ("control.delta = { values = [] }", "samples = 9", "expected a list of values"),
        ("control.delta = { values = [-1.0] }", "samples = 9", r"vary\.control\.delta: expected .*>= 0.*-1"),
        ("control.delta = { values = [true] }", "samples = 9", r"vary\.control\.delta: expected a number"),
        ("control.delta = { uniform = [-1, 1] }", "samples = 9", r"vary\.control\.delta: expected .*>= 0"),
        ("control.delta = { normal = [0.05, 0.1] }", "samples = 99", r"row \d+ of the sample is not"),
        ("control.nu = { uniform = [2, 4] }", "samples = 9", "positive even integer.*values"),
        ("control.law = { values = ['powr'] }", "samples = 9", r"vary\.control\.law: unknown law.*'power'"),
        ("control.law = { uniform = [0, 1] }", "samples = 9", r"expected \{ values"),
        ("simulation.duration = { values = [0.00015] }", "samples = 9", "whole multiple"),
        ("control.k1 = { tie = 'control.k2' }", "samples = 9", "unknown key that varies by itself"),
        ("control.k1.uniform = [1, 2]\ncontrol.k2 = { tie = 'control.k1', values = [1] }", "samples = 9", "as many"),
        ("control.k1 = { uniform = [1, 2], factor = 2 }", "samples = 9", "only goes with a tie"),
        ("control.k1 = { uniform = [1, 2], points = 5 }", "samples = 9", "only goes with uniform"),
        ("control.k1 = { uniform = [1, 2] }", "samples = 0", r"samples: expected a whole number in \[1, "),
        ("control.k1 = { uniform = [1, 2] }", "", "samples: is missing"),
        ("control.k1 = { uniform = [1, 2] }", "samples = 9\nmethod = 'sobel'", "unknown method.*'sobol'"),
        ("control.k1 = { uniform = [1, 2] }", "samples = 9\nseed = -1", "seed: expected"),
        ("control.k1 = { uniform = [1, 2] }", "samples = 9\nsample = 3", "sample: unknown key.*'samples'"),
        ("control.k1 = { uniform = [1, 2] }", "samples = 9\n[set]\ncontrol.k9 = 3", r"set: override of .*\.k9.*k1"),
        ("control.k1 = { uniform = [1, 2] }", "method = 'grid'", "number of points"),
        ("control.k1 = { normal = [1, 2] }", "method = 'grid'", "no normal axis"),
        ("control.k1 = { values = [1, 2] }", "method = 'grid'\nsamples = 9", "a grid takes none"),
        ("", "samples = 9", "at least one key"),
        (
            "\n".join(f"control.{k} = {{ uniform = [1, 2], points = 10000 }}" for k in ("k1", "k2", "k3")),
            "method = 'grid'",
            r"at most 1,000,000,000 runs.*1e\+12",
        ),
    ],
)  # fmt: skip
def test_mistakes_are_named(write: Write, vary: str, head: str, message: str) -> None:
    with pytest.raises(InputError, match=f"(?s){message}"):
        plan_of(write(vary, head))


def test_keys_without_numbers_of_their_own_may_be_tied(write: Write) -> None:
    vary = "control.l = { each = [3, 5] }\ncontrol.r = { tie = 'control.l' }\ncontrol.k1 = { uniform = [1, 2] }"
    assert [group.constants["control.r"] for group in plan_of(write(vary)).groups] == [3, 5]


def test_sweeps_that_no_folder_or_counter_holds_are_refused(write: Write) -> None:
    vary = "control.k1 = { uniform = [1, 2] }"
    with pytest.raises(InputError, match=r"chunk: expected at least 1001: 1,000,000,000 parts .*1,000,000, got 1$"):
        plan_of(write(vary, "samples = 1000000000\nchunk = 1"))
    assert plan_of(write(vary, "samples = 1000000000\nchunk = 1001")).chunks == 999_001
    long = "\n[set]\nsimulation.duration = 1e11\nsimulation.step = 1e-2"
    with pytest.raises(InputError, match=r"samples: expected fewer .* 10,000,000,000,000,000,000,000 steps are more"):
        plan_of(write(vary, f"samples = 1000000000\nchunk = 65536{long}"))
    assert plan_of(write(vary, f"samples = 900000{long}")).chunks


def test_a_long_sweep_gets_chunks_that_a_folder_has_room_for(write: Write) -> None:
    head = "samples = 1000000000\n[set]\nsimulation.duration = 4000.0"
    assert 900_000 < plan_of(write("control.k1 = { uniform = [1, 2] }", head)).chunks <= 1_000_000


def test_overrides_take_the_place_of_the_sweeps_own(write: Write) -> None:
    file = write("control.k1 = { uniform = [1, 2] }", "samples = 9\n[set]\nsimulation.duration = 2.0")
    sweep = load_sweep(file, {"simulation.duration": 1.0, "control.delta": 0.03})
    assert sweep.scenario.value_of("simulation.duration") == 1.0
    assert sweep.scenario.value_of("control.delta") == 0.03
    assert load_sweep(file).scenario.value_of("simulation.duration") == 2.0
    with pytest.raises(InputError, match=r"override of paper/nominal: control\.delt"):
        load_sweep(file, {"control.delt": 1.0})


@pytest.mark.parametrize(
    ("vary", "key", "refused"),
    [
        ("control.a_max", "control.a_max", True),
        ("control.a_max", "control.a_max.1", True),
        ("control.a_max.0", "control.a_max", False),
        ("control.a_max.0", "control.a_max.1", False),
        ("plant.m3.scale", "plant.m3", True),
        ("plant.m3", "plant.m3.scale", True),
        ("plant.m3", "mechanism.m3", False),
        ("control.k1", "control.k2", False),
    ],
)
def test_an_override_of_what_varies_is_refused(write: Write, vary: str, key: str, *, refused: bool) -> None:
    file = write(f"{vary} = {{ uniform = [20, 30] }}")
    if not refused:
        load_sweep(file, {key: 25.0})
        return
    with pytest.raises(InputError, match=rf"{key}: it varies in this sweep \(vary\.{vary}\)"):
        load_sweep(file, {key: 25.0})


MANY, ENDLESS, HEX = "9" * 400, "9" * 6000, "0x" + "f" * 6000
UNLIKELY = [
    (f"control.k1 = {{ values = [1, {MANY}] }}", "samples = 9", r"vary\.control\.k1: expected a number > 0"),
    ("control.k1 = { each = [1, 9007199254740993] }", "samples = 9", "no 64-bit float is 9007199254740993"),
    (f"control.k1 = {{ uniform = [1, {MANY}] }}", "samples = 9", "two finite numbers"),
    (f"control.k1 = {{ uniform = [1, 2], points = {MANY} }}", "method = 'grid'", r"1\.00e\+400 runs"),
    ("control.k1 = { uniform = [1, 2] }", f"samples = {ENDLESS}", "no valid TOML: an integer has thousands of"),
    ("control.k1 = { uniform = [1, 2] }", f"samples = {HEX}", r"samples: expected a whole.*got 0xfff"),
    (f"control.k1 = {{ tie = 'control.k2', factor = {MANY} }}", "samples = 9", "other than 0"),
    (f"simulation.output_every = {{ each = [{HEX}, 'a'] }}", "samples = 9", r"vary\.simulation\.output_every"),
    ("[" * 3000, "samples = 9", "is no valid TOML"),
    ("control.k1 = " + "[" * 3000 + "]" * 3000, "samples = 9", "no valid TOML: tables and lists"),
    ("control.k1 = " + "[" * 300 + "]" * 300, "samples = 9", "no valid TOML: tables and lists"),
    ("a." * 5000 + "b.uniform = [1, 2]", "samples = 9", "no valid TOML: tables and lists"),
    ("control.k1 = { uniform = [1, 2] }", f"samples = 9\n[set]\n{'a.' * 20}b = 1", "set: .*at most 16 parts"),
    *(
        (f"simulation.duration = {{ each = {values} }}\n{tied}", "samples = 9", r"vary\.")
        for values in ('[0.001, "a"]', "[0.001, true]", "[0.001, [1]]", "[1, { a = 1 }]", "[1, 1979-05-27]")
        for tied in (
            "",
            "control.k1 = { tie = 'simulation.duration', factor = 3 }",
            "control.k1 = { tie = 'simulation.duration' }",
            "simulation.output_every = { tie = 'simulation.duration', values = [1, 2] }",
            "simulation.bound = { tie = 'simulation.duration' }",
        )
    ),
]


@pytest.mark.parametrize(("vary", "head", "message"), UNLIKELY, ids=range(len(UNLIKELY)))
def test_what_nobody_would_write_is_named_too(write: Write, vary: str, head: str, message: str) -> None:
    with pytest.raises(InputError, match=f"(?s){message}"):
        plan_of(write(vary, head))


def test_a_missing_file_suggests_the_packaged_sweeps() -> None:
    with pytest.raises(InputError, match="did you mean 'stability_map'"):
        load_sweep("stability_mop")


def test_an_unknown_scenario_is_named(write: Write) -> None:
    with pytest.raises(InputError, match="paper/nominal"):
        load_sweep(write("control.k1 = { uniform = [1, 2] }", scenario="paper/nominel"))


def test_a_wrong_scenario_is_named_with_the_sweep_that_asks_for_it(tmp_path: Path) -> None:
    path = tmp_path / "sweep.toml"
    path.write_text('scenario = "paper/nominl"\nsamples = 4\n[vary]\n"control.delta" = { uniform = [0.03, 0.05] }\n')
    with pytest.raises(InputError, match=r"sweep\.toml: scenario: .*paper/nominal"):
        load_sweep(path)


def test_bands_of_metrics_vary_within_a_group(write: Write) -> None:
    """They move nothing of a run, so that no other kernel is needed; an error takes the place of the band."""
    vary = "simulation.settling_error = { uniform = [0.01, 0.3] }\nsimulation.response_band = { values = [0.1, 0.4] }"
    plan = plan_of(write(vary, "samples = 8\n[set]\nsimulation.duration = 1.5\nsimulation.response_error = 0.1"))
    (group,) = plan.groups
    assert group.work.parameters == ()
    chunk = plan.chunk(0)
    inputs = plan.inputs(chunk, plan.columns(chunk))
    with open_pool(1) as pool:
        table = plan.table(chunk, plan.columns(chunk), pool.submit(group.work, inputs, []).result())
    assert [field.metadata[b"unit"] for field in plan.key_fields] == [b"m or rad", b"1"]
    for run in range(8):
        expected = simulate(plan.scenario_of(run)).metrics.to_pylist()[0]
        assert {name: table[name][run].as_py() for name in expected} == expected
    assert len(set(table["settling_time_lift"].to_pylist())) == 8
    both = "simulation.settling_error = { values = [0.1] }\nsimulation.settling_band = { values = [0.1] }"
    with pytest.raises(
        InputError, match=r"vary\.simulation\.settling_error: does not go with simulation\.settling_band"
    ):
        plan_of(write(both))
