"""Scenario files: what they mean, what they refuse and how they say it, and the packaged ones."""

from __future__ import annotations

import math
import os
import pickle
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from springline.model.control import CONTROLLERS, LAWS
from springline.model.parameters import Bounds
from springline.model.structure import SignalShape, Structure
from springline.runner.files import InputError, value_text
from springline.runner.scenario import Scenario, kernel_tables, load_scenario, packaged_scenarios

GROUPS = {
    "paper/group1_shake": {},
    "paper/group1_pitch": {},
    "paper/group1_roll": {},
    "paper/group2_variable_power_log": {},
    "paper/group2_double_power": {"control.law": "double_power"},
    "paper/group2_power": {"control.law": "power"},
    "paper/group3_nominal": {},
    "paper/group3_payload_plus": {"plant.m3": 48.0, "plant.J": 1.2 * 40.0 * 0.74**2 / 3.0},
    "paper/group3_payload_minus": {"plant.m3": 32.0, "plant.J": 0.8 * 40.0 * 0.74**2 / 3.0},
    "paper/group4_fast_on": {},
    "paper/group4_fast_off": {"control.fast": False, "control.K_f.0": 0.0, "control.K_f.1": 0.0},
}
"""What each run of the paper's Table 2 has of its own."""


@pytest.fixture
def load(tmp_path: Path):
    """Load a scenario from TOML text."""

    def load(text: str, overrides: dict[str, object] | None = None) -> Scenario:
        file = tmp_path / "s.toml"
        file.write_text(text, encoding="utf-8")
        return load_scenario(file, overrides)

    return load


@pytest.fixture
def told(load):
    """The message for a scenario that is refused."""

    def told(text: str, overrides: dict[str, object] | None = None) -> str:
        with pytest.raises(InputError) as caught:
            load(text, overrides)
        assert caught.value.exit_code == 2
        return str(caught.value)

    return told


def slots(scenario: Scenario) -> dict[str, float]:
    """p by slot key."""
    return dict(zip((slot.key for slot in scenario.system().slots), scenario.values(), strict=True))


# The packaged scenarios


def test_the_packaged_scenarios_are_those_of_the_design() -> None:
    rivals = {f"controllers/{name}" for name in CONTROLLERS if name != "terminal_sliding"}
    others = {"paper/nominal", "paper/as_printed", "controllers/reproducible_chatter", "ship/vessel_10hz"}
    limited = {name.replace("paper/", "paper_motor_limit/") for name in (*GROUPS, "paper/nominal")}
    assert set(packaged_scenarios()) == {*GROUPS, *rivals, *others, *limited}


def test_an_empty_file_is_the_paper_s_nominal(load) -> None:
    nominal = load_scenario("paper/nominal")
    assert load("") == nominal
    assert nominal.structure() == Structure()
    assert (nominal.steps, nominal.step, nominal.control_every) == (40_000, 1e-4, 0)
    assert (nominal.output_every, nominal.bound, nominal.integrator) == (10, 1e6, "rk4")
    assert (nominal.response_band, nominal.settling_band) == (0.10, 0.05)
    table_3 = {
        "mechanism.m2": 10, "mechanism.m3": 40, "mechanism.L3": 0.74, "mechanism.g": 9.8, "drive.m_l": 2,
        "drive.I": 0.01, "drive.k_s2": 2e6, "drive.k_s3": 2e4, "control.k1": 3, "control.k2": 5, "control.k3": 12,
        "control.alpha": 0.5, "control.beta": 5, "control.mu.0": 12, "control.mu.1": 5, "control.lambda": 5,
        "control.epsilon_log": 10, "control.nu": 2, "control.zeta": 0.9, "control.K_f.0": 200, "control.K_f.1": 2.6,
    }  # fmt: skip
    ours = {
        "mechanism.J": 40 * 0.74**2 / 3, "mechanism.L1": 0.5, "control.delta": 0.05, "control.a_max.0": 200,
        "control.a_max.1": 200, "control.U_max.0": math.inf, "control.U_max.1": math.inf,
    }  # fmt: skip
    start = {"initial.q.0": 0.8, "initial.q.1": 0.5, "initial.dq.0": 0, "initial.dq.1": 0}
    reference = {
        "reference.lift.offset": 0, "reference.lift.terms.0.amplitude": 1, "reference.lift.terms.0.omega": math.pi,
        "reference.rotation.offset": 1, "reference.rotation.terms.0.amplitude": 1,
        "reference.rotation.terms.0.omega": math.pi / 2,
    }  # fmt: skip
    values = slots(nominal)
    for key, value in (table_3 | ours | start | reference).items():
        assert values[key] == value, key
    for key, value in values.items():
        if key.startswith("plant."):
            assert value == values.get(key.replace("plant", "mechanism"), values.get(key.replace("plant", "drive")))


def test_every_default_is_the_declared_one(load) -> None:
    values = slots(load(""))
    for slot in load("").system().slots:
        if slot.key.split(".")[0] in ("mechanism", "drive", "plant", "control"):
            assert values[slot.key] == slot.default, slot.key


@pytest.mark.parametrize("name", GROUPS)
def test_a_run_of_table_2_is_the_nominal_one_but_for_what_the_table_says(name: str) -> None:
    scenario = load_scenario(name)
    moving = scenario.document["base_motion"]
    assert moving["kind"] == "sine"
    only = name.rpartition("_")[2].replace("shake", "heave") if "group1" in name else "heave"
    assert [key for key in ("surge", "sway", "heave", "roll", "pitch", "yaw") if moving[key]] == [only]
    own = GROUPS[name]
    rest = scenario.with_overrides({"base_motion.kind": "none", "control.law": "variable_power_log"})
    values, nominal = slots(rest), slots(load_scenario("paper/nominal"))
    assert values == pytest.approx(nominal | {k: v for k, v in own.items() if k in nominal}, rel=1e-15)
    assert scenario.value_of("control.law") == own.get("control.law", "variable_power_log")
    assert scenario.value_of("control.fast") == own.get("control.fast", True)


def test_groups_1_to_4_share_one_shake() -> None:
    shaken = [load_scenario(name) for name in GROUPS if name not in ("paper/group1_pitch", "paper/group1_roll")]
    assert len({value_text(s.document["base_motion"]) for s in shaken}) == 1
    same = ("group1_shake", "group2_variable_power_log", "group3_nominal", "group4_fast_on")
    assert len({load_scenario(f"paper/{name}") for name in same}) == 1


def test_as_printed_has_no_boundary_layer_and_no_limit() -> None:
    values = slots(load_scenario("paper/as_printed"))
    assert values["control.delta"] == 0
    assert all(values[f"control.{limit}.{i}"] == math.inf for limit in ("a_max", "U_max") for i in (0, 1))
    assert load_scenario("paper/as_printed").structure() == Structure()


def test_the_vessel_record_moves_all_six_coordinates_for_a_minute() -> None:
    scenario = load_scenario("ship/vessel_10hz")
    assert scenario.structure().base_motion == SignalShape("table", (1,) * 6)
    (table,) = scenario.tables()
    (layout,) = scenario.system().tables
    assert layout.channels == (0, 1, 2, 3, 4, 5) and table.coefficients.shape[1] == 6
    assert scenario.steps * scenario.step == 60.0
    assert (table.dt / scenario.step).is_integer()  # every knot is a step
    # Facts of the record: standard deviations of heave (m), pitch and roll (deg).
    spread = table.coefficients[:, :3, 0].std(axis=0) * [1, 180 / math.pi, 180 / math.pi]
    assert spread == pytest.approx([0.682, 0.53, 1.22], abs=0.005)
    assert scenario.with_overrides({"simulation.duration": 359.0}).steps == 359 * 8192


@pytest.mark.parametrize("name", sorted({*GROUPS, "paper/nominal", "paper/as_printed", "ship/vessel_10hz"}))
def test_a_resolved_scenario_is_complete_and_stands_for_itself(name: str, load) -> None:
    scenario = load_scenario(name)
    text = scenario.to_toml()
    again = load(text)
    assert again == scenario and hash(again) == hash(scenario)
    assert again.to_toml() == text
    assert set(tomllib.loads(text)) == set(scenario.document)
    assert np.array_equal(again.values(), scenario.values())
    assert pickle.loads(pickle.dumps(scenario)) == scenario  # noqa: S301 - our own bytes


# What a file means


def test_one_number_stands_for_all_joints(load) -> None:
    values = slots(load("[control]\nmu = 7\nU_max = 900\n[initial]\nq = 0.1\nq_motor = [0.2, 0.3]"))
    assert values["control.mu.0"] == values["control.mu.1"] == 7.0
    assert values["control.U_max.0"] == 900.0
    assert (values["initial.q.1"], values["initial.q_motor.1"]) == (0.1, 0.3)


def test_the_plant_follows_the_controller_unless_it_has_its_own(load) -> None:
    text = "[mechanism]\nm3 = 50\nL1 = 0.2\n[drive]\nm_l = 3\n[plant]\nm3 = { scale = 1.2 }\nk_s2 = 1e6"
    values = slots(load(text))
    assert values["mechanism.m3"] == 50 and values["plant.m3"] == 60
    assert values["plant.L1"] == 0.2 and values["plant.m_l"] == 3
    assert values["plant.k_s2"] == 1e6 and values["drive.k_s2"] == 2e6


def test_fast_off_is_a_gain_of_zero_and_no_other_structure(load) -> None:
    off = load("[control]\nfast = false\nK_f = [100, 1]")
    assert off.structure() == Structure()
    assert slots(off)["control.K_f.0"] == slots(off)["control.K_f.1"] == 0.0
    assert slots(off.with_overrides({"control.fast": True}))["control.K_f.0"] == 100.0


def test_sampled_control_counts_steps(load) -> None:
    assert load('[control]\nmode = "sampled"\nperiod = 1e-3').control_every == 10


def test_structure_comes_from_the_file(load) -> None:
    text = """
    [control]
    law = "power"
    log_form = "base"
    l = 5
    m = 3
    r = 7
    p = 5
    [reference]
    lift = { offset = 2.0 }
    [base_motion]
    kind = "sine"
    roll = [{ amplitude = 1, omega = 2 }, { amplitude = 3, omega = 4, phase = 5 }]
    [initial]
    q_motor = "equilibrium"
    """
    structure = load(text).structure()
    assert (structure.law, structure.log_form, structure.initial_motor) == ("power", "base", "equilibrium")
    assert [getattr(structure.exponents, name) for name in "lmpr"] == [5, 3, 5, 7]
    assert structure.reference == SignalShape("sine", (0, 1))  # a given joint starts empty, the other keeps its default
    assert structure.base_motion == SignalShape("sine", (0, 0, 2))
    values = slots(load(text))
    assert values["base_motion.roll.1.phase"] == 5.0 and values["base_motion.roll.0.phase"] == 0.0
    assert values["reference.lift.offset"] == 2.0


def test_tables_are_found_beside_the_scenario(load, tmp_path: Path) -> None:
    t = np.arange(50) / 10
    np.savetxt(tmp_path / "ref.csv", np.column_stack([t * 1000, 90 * t]), delimiter=",", header="ms,deg", comments="")
    scenario = load(
        """
        [reference]
        kind = "table"
        path = "ref.csv"
        columns = { t = "ms", rotation = "deg" }
        units = { t = "ms", rotation = "deg" }
        """
    )
    assert scenario.structure().reference == SignalShape("table", (0, 1))
    (table,) = scenario.tables()
    assert table.ends == "hold" and table.end == pytest.approx(4.9)
    assert table.coefficients[-1, 0, 0] == pytest.approx(math.pi / 2 * 4.8)
    assert load(scenario.to_toml()) == scenario
    with pytest.raises(InputError, match=r"lasts from 0 to 4\.9 s: expected all of 0 to 5 s"):
        scenario.with_overrides({"reference.ends": "error", "simulation.duration": 5.0})
    assert scenario.with_overrides({"reference.kind": "sine"}).structure().reference == SignalShape("sine", (1, 1))


# What a file may not say


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        pytest.param("[mechanism]\nm3 = -1", ["mechanism.m3", "a number > 0 [kg]", "got -1"], id="negative mass"),
        pytest.param("[mechanism]\nm3 = nan", ["mechanism.m3", "a number > 0 [kg]", "got nan"], id="NaN"),
        pytest.param("[mechanism]\nm3 = inf", ["mechanism.m3", "got inf"], id="infinite mass"),
        pytest.param(f"[mechanism]\nm3 = 1{'0' * 400}", ["mechanism.m3", "a number > 0 [kg]"], id="huge integer"),
        pytest.param("[mechanism]\nm3 = true", ["mechanism.m3", "a number", "got true"], id="bool for a number"),
        pytest.param('[mechanism]\nm3 = "40"', ["mechanism.m3", "a number", 'got "40"'], id="text for a number"),
        pytest.param("[mechanism]\nmass3 = 1", ["mechanism.mass3", "unknown key", "m2, m3"], id="unknown key"),
        pytest.param("[control]\nlamda = 1", ["control.lamda", "did you mean 'lambda'?"], id="nearest key"),
        pytest.param("[controls]\nk1 = 1", ["controls", "unknown table", "'control'"], id="unknown table"),
        pytest.param("control = 3", ["control", "expected a table", "got 3"], id="no table"),
        pytest.param('[mechanism]\nname = "arm"', ["mechanism.name", "transfer_manipulator"], id="mechanism"),
        pytest.param("[mechanism]\nname = [1]", ["mechanism.name", "got [1]"], id="mechanism is no text"),
        pytest.param("a = " + "[" * 10000, ["no valid TOML"], id="too deep"),
        pytest.param(f"a = {'1' * 5000}", ["no valid TOML"], id="too many digits"),
        pytest.param('[control]\nlaw = "powr"', ["control.law", "unknown law", "'power'", *LAWS], id="law"),
        pytest.param('[control]\nlaw = "POWER"', ["did you mean 'power'?"], id="capital letters"),
        pytest.param("[control]\nlaw = 3", ["control.law", "got 3"], id="law is no text"),
        pytest.param('[control]\nlog_form = "powers"', ["control.log_form", "'power'"], id="log form"),
        pytest.param("[control]\nl = 2", ["control.l", "a positive odd integer", "got 2"], id="even l"),
        pytest.param("[control]\nr = 3.0", ["control.r", "a positive odd integer", "got 3.0"], id="float r"),
        pytest.param("[control]\nm = -1", ["control.m", "a positive odd integer"], id="negative m"),
        pytest.param("[control]\nm = 3", ["control.l", "expected l > m", "l = 3, m = 3"], id="l > m"),
        pytest.param("[control]\np = 5", ["control.r", "expected r > p", "r = 3, p = 5"], id="r > p"),
        pytest.param("[control]\nalpha = 1", ["control.alpha", "a number in (0, 1)", "got 1"], id="alpha"),
        pytest.param("[control]\nbeta = 1.0", ["control.beta", "a number > 1", "got 1.0"], id="beta"),
        pytest.param("[control]\nzeta = 0", ["control.zeta", "a number in (0, 1)"], id="zeta"),
        pytest.param("[control]\nnu = 3", ["control.nu", "a positive even integer", "got 3"], id="nu"),
        pytest.param("[control]\nmu = [1]", ["control.mu", "a list of 2 (lift, rotation)", "got [1]"], id="short list"),
        pytest.param("[control]\nmu = [1, -2]", ["control.mu.1", "a number > 0 [1/s]", "got -2"], id="one of a list"),
        pytest.param("[control]\nK_f = -1", ["control.K_f", "a number >= 0", "N m s/rad"], id="gain"),
        pytest.param("[control]\na_max = 0", ["control.a_max", "(inf means no limit)"], id="limit of zero"),
        pytest.param("[control]\ndelta = -0.1", ["control.delta", "a number >= 0 [m or rad]"], id="unit of delta"),
        pytest.param('[control]\nfast = "yes"', ["control.fast", "true or false"], id="truth"),
        pytest.param('[control]\nmode = "sampled"', ["control.period", "is missing", "a number > 0 [s]"], id="period"),
        pytest.param("[control]\nperiod = 0.1", ["control.period", 'mode = "sampled"'], id="mode forgotten"),
        pytest.param(
            '[control]\nmode = "continuous"\nperiod = 0.1',
            ["control.period", 'mode = "sampled"'],
            id="not sampled",
        ),
        pytest.param(
            '[control]\nmode = "sampled"\nperiod = 2.5e-4',
            ["control.period", "whole multiple of simulation.step = 0.0001 s", "nearest is 0.0002 s"],
            id="period and step",
        ),
        pytest.param("[simulation]\nduration = 1.00005", ["simulation.duration", "whole multiple"], id="duration"),
        pytest.param("[simulation]\nstep = 5", ["simulation.duration", "nearest is 5 s"], id="step over duration"),
        pytest.param("[simulation]\nstep = 0", ["simulation.step", "a number > 0 [s]"], id="step"),
        pytest.param("[simulation]\noutput_every = 0", ["simulation.output_every", "positive integer"], id="output"),
        pytest.param('[simulation]\nintegrator = "rk5"', ["simulation.integrator", "'rk4'"], id="integrator"),
        pytest.param("[simulation]\nsettling_band = 1.5", ["simulation.settling_band", "(0, 1)"], id="band"),
        pytest.param("[plant]\nepsilon = 1", ["plant.epsilon", "unknown key"], id="plant has no epsilon"),
        pytest.param("[plant]\nm3 = { scale = 0 }", ["plant.m3.scale", "a number > 0", "got 0"], id="scale"),
        pytest.param("[plant]\nm3 = { factor = 2 }", ["plant.m3.factor", "(valid: scale)"], id="no scale"),
        pytest.param('[plant]\nm3 = "x"', ["plant.m3", "or { scale = a number > 0 }"], id="plant value"),
        pytest.param('[reference]\nkind = "sin"', ["reference.kind", "did you mean 'sine'?"], id="kind"),
        pytest.param('[reference]\nkind = "none"', ["reference.kind", "sine, polynomial, table"], id="reference none"),
        pytest.param("[reference]\nlift = 3", ["reference.lift", "{ offset, terms }", "got 3"], id="no signal"),
        pytest.param(
            "[reference]\nlift = { terms = { omega = 1 } }",
            ["reference.lift.terms", "a list of tables with { amplitude, omega, phase }"],
            id="no list of terms",
        ),
        pytest.param(
            "[reference]\nlift = { terms = [{ amplitude = 1 }] }",
            ["reference.lift.terms.0.omega", "is missing", "[rad/s]"],
            id="term without omega",
        ),
        pytest.param(
            '[base_motion]\nkind = "sine"\nheel = []',
            ["base_motion.heel", "unknown key", "heave, pitch, roll, surge, sway, yaw"],
            id="unknown oscillation",
        ),
        pytest.param(
            "[base_motion]\nshake = []", ["base_motion.shake", "'sine'", "(the default)"], id="kind forgotten"
        ),
        pytest.param(
            '[base_motion]\nkind = "sine"\npath = "x.csv"', ["base_motion.path", "kind = 'table'"], id="wrong kind"
        ),
        pytest.param(
            '[base_motion]\nkind = "table"', ["base_motion.path", "base_motion.columns", "is missing"], id="no path"
        ),
        pytest.param("[initial]\nq = [1, nan]", ["initial.q.1", "a finite number [rad]"], id="start"),
        pytest.param('[initial]\nq_motor = "unload"', ["initial.q_motor", "'unloaded'"], id="motor start"),
        pytest.param("[initial]\nq_motor = [1]", ["initial.q_motor", "a list of 2"], id="motor list"),
        pytest.param("[control]\nk1 = = 3", ["no valid TOML", "line 2"], id="syntax"),
    ],
)
def test_mistakes_are_told(text: str, expected: list[str], told) -> None:
    message = told(text)
    assert "s.toml" in message
    assert all(part in message for part in expected), message


def test_all_mistakes_are_told_at_once(told) -> None:
    message = told("[mechanism]\nm2 = 0\nm3 = 0\n[control]\nl = 1\n[simulation]\nduration = 1.00005\noutput_every = 0")
    keys = [line.split(": ")[1] for line in message.splitlines()]
    expected = {"mechanism.m2", "mechanism.m3", "control.l", "simulation.duration", "simulation.output_every"}
    assert set(keys) == expected and len(keys) == 5


TABLE = """
[base_motion]
kind = "table"
path = "{path}"
columns = {{ t = "t", shake = "a" }}
units = {{ {units} }}
ends = "{ends}"
"""


@pytest.mark.parametrize(
    ("path", "units", "ends", "expected"),
    [
        ("motoin.csv", "", "hold", ["base_motion.path", "motoin.csv; did you mean 'motion.csv'?"]),
        ("springline:data/vessel.csv", "", "hold", ["did you mean 'springline:data/vessel_orcaflex_10hz.csv'?"]),
        ("motion.csv", 'shake = "deg"', "hold", ["base_motion.units.shake", "unknown unit", "m, mm, cm, km"]),
        ("motion.csv", 'roll = "deg"', "hold", ["base_motion.units.roll", "there is no columns.roll"]),
        ("motion.csv", "", "stop", ["base_motion.ends", "hold, periodic, error"]),
        ("motion.csv", "", "error", ["base_motion.ends", "lasts from 0 to 2 s", "0 to 4 s"]),
        ("other.csv", "", "hold", ["base_motion.columns.shake", "unknown column", "'a'"]),
        ("", "", "hold", ["base_motion.path", "a text in quotes"]),
        (".", "", "hold", ["base_motion.path", "cannot be read"]),
        ("a\\u0000b.csv", "", "hold", ["base_motion.path", "is no path of a file", "null"]),
        ("loop.csv", "", "hold", ["base_motion.path", "cannot be read", "symbolic links"]),
        ("loop.csv/x.csv", "", "hold", ["base_motion.path", "cannot be read"]),
        ("pipe.csv", "", "hold", ["base_motion.path", "a pipe or a device: expected a regular file"]),
        ("/dev/zero", "", "hold", ["base_motion.path", "/dev/zero", "a pipe or a device"]),
        ("huge.csv", "", "hold", ["base_motion.path", "more than 1024 MiB"]),
        ("a" * 5000, "", "hold", ["base_motion.path", "cannot be read"]),
    ],
)
def test_mistakes_about_tables_are_told(
    path: str, units: str, ends: str, expected: list[str], told, tmp_path: Path
) -> None:
    (tmp_path / "motion.csv").write_text("t,a\n" + "".join(f"{k / 4},{k}\n" for k in range(9)))
    (tmp_path / "other.csv").write_text("t,b\n0,0\n1,0\n2,0\n3,0\n")
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    os.mkfifo(tmp_path / "pipe.csv")
    with (tmp_path / "huge.csv").open("wb") as file:
        file.truncate(2**30 + 1)  # a hole, which takes no room on the disk
    message = told(TABLE.format(path=path, units=units, ends=ends))
    assert "s.toml" in message
    assert all(part in message for part in expected), message


def test_a_table_needs_a_coordinate(told) -> None:
    message = told('[base_motion]\nkind = "table"\npath = "x.csv"\ncolumns = { t = "t" }')
    assert "base_motion.columns" in message and "at least one of heave, pitch, roll, surge, sway, yaw" in message


# Where the run lies in the record


@pytest.fixture
def recorded(load, tmp_path: Path):
    """A scenario with a record of some times (s) and values (m) as its base's shake; `extra` adds to the table."""

    def recorded(times: np.ndarray, values: np.ndarray, extra: str = "", duration: float = 4.0) -> Scenario:
        lines = "".join(f"{t!r},{v!r}\n" for t, v in zip(times.tolist(), values.tolist(), strict=True))
        (tmp_path / "motion.csv").write_text(f"t,a\n{lines}")
        return load(TABLE.format(path="motion.csv", units="", ends="hold") + extra, {"simulation.duration": duration})

    return recorded


@pytest.mark.parametrize(
    ("start", "unit", "extra", "told"),
    [
        (1.7e9, 1.0, "", ["lasts from 1700000000 to 1700000010 s", "the run takes 0 to 4 s", "t0 = 1700000000 starts"]),
        (1.7e12, 1e3, "", ["lasts from 1700000000000 to 1700000010000 s", "units.t"]),
        (4.0, 1.0, "", ["lasts from 4 to 14 s", "takes 0 to 4 s", "t0 = 4 starts", "got 0.0 s"]),
        (-10.0, 1.0, "", ["lasts from -10 to 0 s", "takes 0 to 4 s"]),
        (0.0, 1.0, "t0 = 10.5", ["lasts from 0 to 10 s", "takes 10.5 to 14.5 s", "t0 = 0 starts", "got 10.5 s"]),
        (25.0, 1.0, "t0 = 20.5", ["lasts from 25 to 35 s", "takes 20.5 to 24.5 s", "got 20.5 s"]),
    ],
)
def test_a_record_beside_the_run_is_told(start: float, unit: float, extra: str, told: list[str], recorded) -> None:
    t = start + np.linspace(0.0, 10.0, 41) * unit
    with pytest.raises(InputError) as caught:
        recorded(t, np.sin(np.arange(41.0)), extra)
    (problem,) = caught.value.problems
    assert problem.key == "base_motion.t0"
    assert all(part in str(problem) for part in told), str(problem)


@pytest.mark.parametrize(
    ("start", "extra", "duration", "told"),
    [
        (1.7e9, "t0 = 1700000000", 4.0, ["lasts from 1700000000 to 1700000010 s", "1700000000 to 1700000004 s of it"]),
        (1.7e9, "t0 = 1700000003.25", 2.0, ["1700000003.25 to 1700000005.25 s of it"]),
        (0.0, "", 4.0, ["lasts from 0 to 10 s", "the run takes 0 to 4 s of it"]),
        (1.0, "", 4.0, ["takes 0 to 4 s of it; before the record the motion starts from rest at its first value"]),
        (0.0, "t0 = 8.0", 4.0, ["takes 8 to 12 s of it; after the record the motion comes to rest at its last value"]),
        (0.0, "", 0.1, ["less than one of its sample intervals of 0.25 s (is units.t right?)"]),
    ],
)
def test_a_note_tells_the_span_that_the_run_uses(
    start: float, extra: str, duration: float, told: list[str], recorded
) -> None:
    scenario = recorded(start + np.linspace(0.0, 10.0, 41), np.sin(np.arange(41.0)), extra, duration)
    note, *_ = scenario.notes
    assert note.startswith("base_motion: ") and all(part in note for part in told), note
    assert ("rest" in note) == ("rest" in told[-1])
    assert scenario.with_overrides({"base_motion.kind": "none"}).notes == ()


@pytest.mark.parametrize(("bend", "far"), [(0.05, True), (1.0, False)])
@pytest.mark.parametrize("late", [False, True])
def test_a_note_tells_of_a_motion_that_goes_astray_before_it_rests(
    bend: float, far: bool, late: bool, recorded
) -> None:
    t = np.linspace(0.0, 10.0, 41)
    scenario = recorded(t, t + bend * np.sin(t), "t0 = 5.0" if late else "t0 = -20.0", 40.0)
    note, _ = scenario.notes
    assert ("goes as far as" in note) == far, note
    if far:
        (table,) = kernel_tables(scenario.tables())
        knots = table.t0 + table.dt * np.arange(len(table.coefficients))
        seen = table.coefficients[(knots >= 0.0) & (knots <= 40.0), 0, 0]
        told = float(note.rpartition("goes as far as heave ")[2].split()[0])
        assert told == pytest.approx(seen[np.abs(seen - 5.0).argmax()], rel=1e-3)


def test_t0_moves_the_record_and_nothing_else(recorded) -> None:
    t, values = np.linspace(0.0, 10.0, 41), np.sin(np.arange(41.0))
    (plain,) = recorded(t, values).tables()
    for extra, shift in (("t0 = 2.5", -2.5), ("t0 = -3", 3.0), ("t0 = 0.0", 0.0)):
        (moved,) = recorded(t, values, extra).tables()
        assert moved.t0 == shift and moved.end == plain.end + shift
        assert np.array_equal(moved.coefficients, plain.coefficients)
    (late,) = recorded(1.7e9 + t, values, "t0 = 1700000002.5").tables()
    assert late.t0 == -2.5 and np.array_equal(late.coefficients, plain.coefficients)


def test_t0_is_counted_in_seconds_whatever_the_unit_of_the_times(load, tmp_path: Path) -> None:
    (tmp_path / "ms.csv").write_text("t,a\n" + "".join(f"{k * 60},{k}\n" for k in range(100)))
    text = TABLE.format(path="ms.csv", units='t = "ms"', ends="hold") + "t0 = 1.5"
    (table,) = load(text).tables()
    assert (table.t0, table.end) == (pytest.approx(-1.5), pytest.approx(5.94 - 1.5))
    (table,) = load(text.replace('"ms"', '"min"').replace("1.5", "90")).tables()
    assert (table.t0, table.dt) == (-90.0, 3600.0)


@pytest.mark.parametrize("t0", [0.0, 0.75, -2.0, 1e6 + 0.25, -1.7e9])
def test_a_periodic_record_is_entered_at_t0(t0: float, load, tmp_path: Path) -> None:
    t = np.linspace(0.0, 2.0, 65)
    (tmp_path / "wave.csv").write_text("t,a\n" + "".join(f"{k!r},{math.sin(math.pi * k)!r}\n" for k in t.tolist()))
    scenario = load(TABLE.format(path="wave.csv", units="", ends="periodic") + f"t0 = {t0!r}")
    (table,) = scenario.tables()
    assert -2.0 < table.t0 <= 0.0 and (t0 + table.t0) % 2.0 == 0.0
    note, _ = scenario.notes
    assert note == f"base_motion: {tmp_path / 'wave.csv'} repeats every 2 s, and the run begins at its {t0:.12g} s"


def test_a_run_that_must_lie_in_the_record_does_so_from_t0_on(recorded) -> None:
    t, values = np.linspace(0.0, 10.0, 41), np.sin(np.arange(41.0))
    assert recorded(1.7e9 + t, values, "t0 = 1700000006").with_overrides({"base_motion.ends": "error"}).steps == 40_000
    inside = recorded(t, values, "t0 = 6").with_overrides({"base_motion.ends": "error"})
    assert inside.tables()[0].end == 4.0
    for t0 in (6.1, -0.5):
        with pytest.raises(InputError, match=rf"lasts from 0 to 10 s: expected all of {t0:g} to {t0 + 4:g} s"):
            inside.with_overrides({"base_motion.t0": t0})


def test_wrapped_angles_of_base_and_joints_are_noted(load, tmp_path: Path) -> None:
    t = np.arange(0.0, 8.0)
    turned = 350.0 + 4.0 * t
    lines = zip(t.tolist(), (turned % 360.0).tolist(), turned.tolist(), (turned * 1e3).tolist(), strict=True)
    (tmp_path / "m.csv").write_text("t,wrapped,straight,high\n" + "".join(",".join(map(repr, x)) + "\n" for x in lines))
    base = """
    kind = "table"
    path = "m.csv"
    columns = {{ t = "t", {length} = "high", {angle} = "{column}" }}
    units = {{ {angle} = "deg" }}
    """
    text = "[base_motion]" + base + "[reference]" + base.replace("{length}", "lift").replace("{angle}", "rotation")
    text = text.replace("{length}", "shake").replace("{angle}", "roll")
    wrapped, straight = (load(text.format(column=column)) for column in ("wrapped", "straight"))
    assert wrapped.tables() == straight.tables()
    noted = [note for note in wrapped.notes if "wraps" in note]
    assert [note.split(":")[0] for note in noted] == ["reference.columns.rotation", "base_motion.columns.roll"]
    assert all("at line 5: " in note for note in noted)
    assert not any("wraps" in note for note in straight.notes)


# Where the record lies on the disk


def record_folder(folder: Path, content: str) -> Path:
    """A folder with a scenario and, below it, the record that it names."""
    (folder / "data").mkdir(parents=True)
    (folder / "data" / "motion.csv").write_text(content)
    (folder / "s.toml").write_text(TABLE.format(path="data/motion.csv", units="", ends="hold"))
    return folder / "s.toml"


RECORD = "t,a\n" + "".join(f"{k},{k % 3}\n" for k in range(9))


def test_scenarios_with_the_same_record_are_equal_wherever_it_lies(tmp_path: Path) -> None:
    one, two, other = (
        load_scenario(record_folder(tmp_path / name, content))
        for name, content in (("one", RECORD), ("two", RECORD), ("three", RECORD.replace("8,2", "8,1")))
    )
    assert one == two and hash(one) == hash(two)
    assert one != other
    assert one != two.with_overrides({"base_motion.t0": 1.0})


def test_a_resolved_scenario_finds_its_record_from_where_it_stands(tmp_path: Path) -> None:
    scenario = load_scenario(record_folder(tmp_path / "work", RECORD))
    results = tmp_path / "work" / "results" / "s"
    text = scenario.to_toml(results)
    assert tomllib.loads(text)["base_motion"]["path"] == "../../data/motion.csv"
    results.mkdir(parents=True)
    (results / "scenario.toml").write_text(text)
    (tmp_path / "work").rename(tmp_path / "elsewhere")
    moved = load_scenario(tmp_path / "elsewhere" / "results" / "s" / "scenario.toml")
    assert moved == scenario and moved.to_toml(tmp_path / "elsewhere" / "results" / "s") == text
    packaged = load_scenario("ship/vessel_10hz")
    assert packaged.to_toml(results) == packaged.to_toml()


def test_paths_in_overrides_count_from_the_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record_folder(tmp_path / "here", RECORD)
    monkeypatch.chdir(tmp_path / "here")
    table = {"kind": "table", "path": "data/motion.csv", "columns": {"t": "t", "shake": "a"}}
    scenario = load_scenario("paper/nominal", {"base_motion": table})
    assert scenario.document["base_motion"]["path"] == str(tmp_path / "here" / "data" / "motion.csv")
    monkeypatch.chdir(tmp_path)  # what was found stays found
    assert scenario.with_overrides({"base_motion.t0": 1.0}).tables()[0].t0 == -1.0


def test_a_record_whose_name_no_toml_can_hold_is_refused(tmp_path: Path) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff"))
    with pytest.raises(InputError, match=r"base_motion\.path: is no path of a file \('utf-8' codec can't encode"):
        load_scenario(record_folder(folder, RECORD))


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("pipe.toml", "a pipe or a device: expected a regular file"),
        ("/dev/zero", "a pipe or a device: expected a regular file"),
        ("loop.toml", "symbolic links"),
        ("a\0b.toml", "null"),
        ("huge.toml", "more than 16 MiB"),
    ],
)
def test_what_is_no_file_to_read_is_told(name: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe.toml")
    Path("loop.toml").symlink_to("loop.toml")
    with Path("huge.toml").open("wb") as file:
        file.truncate(2**24 + 1)
    for source in (name, Path(name)):
        with pytest.raises(InputError, match=rf"cannot be read as a text file in UTF-8 \(.*{told}"):
            load_scenario(source)


def test_unknown_scenarios_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean 'paper/nominal'"):
        load_scenario("paper/nominl")
    (tmp_path / "arm.toml").touch()
    with pytest.raises(InputError, match=r"there is no such file; did you mean 'arm\.toml'"):
        load_scenario(tmp_path / "arn.toml")
    with pytest.raises(InputError, match="is a folder: expected a TOML file"):
        load_scenario(tmp_path)
    with pytest.raises(InputError, match=r"a{9}.*: cannot be read"):
        load_scenario("a" * 5000)
    (tmp_path / "latin.toml").write_bytes(b"# \xe4\n")
    with pytest.raises(InputError, match="UTF-8"):
        load_scenario(tmp_path / "latin.toml")


# Overrides


def test_overrides_reach_every_place(load) -> None:
    scenario = load(
        "[control]\nmu = 3",
        {
            "control.delta": 0.02,
            "control.mu.0": 4,
            "plant.m3.scale": np.float64(1.2),
            "plant.J": 9,
            "reference.lift.terms.0.amplitude": 0.5,
            "base_motion.kind": "sine",
            "base_motion.shake": [{"amplitude": 1, "omega": 2}],
            "base_motion.shake.0.omega": 3,
            "simulation.duration": 2.0,
            "initial.q": (0.1, 0.2),
            "control.U_max": 5,
            "control.U_max.1": math.inf,
        },
    )
    values = slots(scenario)
    expected = {
        "control.delta": 0.02, "control.mu.0": 4, "control.mu.1": 3, "plant.m3": 48, "plant.J": 9,
        "reference.lift.terms.0.amplitude": 0.5, "base_motion.heave.0.omega": 3, "initial.q.1": 0.2,
        "control.U_max.0": 5, "control.U_max.1": math.inf,
    }  # fmt: skip
    assert {key: values[key] for key in expected} == expected
    assert scenario.steps == 20_000
    assert load("", {}) == load("")


def test_a_scenario_is_not_changed_by_its_overrides() -> None:
    before = load_scenario("paper/group1_shake")
    after = before.with_overrides({"base_motion.shake.0.omega": 3.0, "plant.m3": 1.0})
    assert before == load_scenario("paper/group1_shake") != after
    assert after.with_overrides({"base_motion.kind": "none"}).structure().base_motion.kind == "none"


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("control.lamda", 1, ["did you mean 'lambda'?"]),
        ("contrl.k1", 1, ["contrl", "did you mean 'control'?"]),
        ("control.k1", -1, ["control.k1", "a number > 0", "got -1"]),
        ("control.k1", "3", ["control.k1", 'got "3"']),
        ("control.k1.scale", 1, ["control.k1", "got { scale = 1 }"]),
        ("control.mu.2", 1, ["control.mu.2", "(0 to 1)"]),
        ("control.mu.lift", 1, ["control.mu.lift", "(0 to 1)", "'lift'"]),
        ("control", 1, ["control", "expected a table"]),
        ("base_motion.shake.0.omega", 1, ["base_motion.shake", "kind = 'sine'"]),
        ("reference.lift.terms.1.omega", 1, ["there is no such entry", "(0 to 0)"]),
        ("control.k1", None, ["control.k1", "got None"]),
        ("", 1, ["unknown table"]),
        # what is told of here is a key of the file that the override no longer suits
        ("control.m", 5, ["control.l", "expected l > m"]),
        ("simulation.step", 3e-4, ["simulation.duration", "whole multiple"]),
        ("control.mode", "sampled", ["control.period", "is missing"]),
    ],
)
def test_mistakes_in_overrides_are_told(key: str, value: object, expected: list[str], told) -> None:
    message = told("", {key: value})
    assert message.startswith("override of ") and "s.toml" in message.partition(": ")[0]
    assert all(part in message for part in expected), message


@pytest.mark.parametrize("overrides", ["control.delta=1", 5, [], [("control.delta", 1.0)], {1: 2.0}])
def test_overrides_of_another_kind_are_told(overrides: Any) -> None:
    with pytest.raises(TypeError, match=r"expected overrides such as \{'control\.delta': 0\.02\}, got"):
        load_scenario("paper/nominal", overrides)


@pytest.mark.parametrize("source", [None, 5, b"paper/nominal", load_scenario("paper/nominal")])
def test_a_source_of_another_kind_is_told(source: Any) -> None:
    with pytest.raises(TypeError, match="expected the path or name of a scenario, got"):
        load_scenario(source)


# Numbers that vary


def test_numeric_keys_are_the_slots_and_their_shorthands() -> None:
    scenario = load_scenario("paper/group1_shake")
    keys = scenario.numeric_keys()
    slot_keys = [slot.key for slot in scenario.system().slots if not slot.key.startswith("initial.q_motor")]
    assert set(slot_keys) < set(keys)
    assert set(keys) - set(slot_keys) == {
        *(f"{key}.scale" for key in slot_keys if key.startswith("plant.")),
        *(f"base_motion.shake.{i}.{name}" for i in (0, 1) for name in ("amplitude", "omega", "phase")),
        "control.mu", "control.K_f", "control.a_max", "control.U_max", "initial.q", "initial.dq",
        *(f"simulation.{of}_{band}" for of in ("response", "settling") for band in ("band", "error")),
    }  # fmt: skip
    assert keys["simulation.settling_error"].unit == "m or rad" and keys["simulation.settling_band"].unit == "1"
    assert keys["control.K_f"].unit == "N s/m or N m s/rad" and keys["control.delta"].unit == "m or rad"
    assert keys["plant.m3"].unit == "kg" and str(keys["plant.m3"].bounds) == "a number > 0"
    assert "initial.q_motor.0" in scenario.with_overrides({"initial.q_motor": [0, 0]}).numeric_keys()


def test_columns_give_what_overrides_give() -> None:
    scenario = load_scenario("paper/group3_payload_plus")
    columns: dict[str, np.ndarray] = {
        "mechanism.m3": np.array([30.0, 40.0, 50.0]),
        "plant.J": np.array([5.0, 6.0, 7.0]),
        "control.mu": np.array([8, 9, 10]),
        "control.mu.1": np.array([2.0, 3.0, 4.0]),
        "control.U_max.0": np.array([1e3, math.inf, 2e3]),
        "base_motion.shake.1.amplitude": np.array([0.0, 0.1, 0.2]),
        "reference.rotation.offset": np.array([0.0, -1.0, 1.0]),
        "initial.dq.0": np.array([0.0, 1.0, 2.0]),
        "drive.k_s2": np.array([1e6, 2e6, 3e6]),
    }
    values = scenario.values_for(columns)
    assert values.shape == (3, len(scenario.system().slots)) and values.dtype == np.float64
    for run in range(3):
        one = scenario.with_overrides({key: column[run] for key, column in columns.items()})
        assert np.array_equal(values[run], one.values())
    at = [slot.key for slot in scenario.system().slots].index
    assert np.array_equal(values[:, at("plant.m3")], 1.2 * columns["mechanism.m3"])
    assert np.array_equal(values[:, at("plant.k_s2")], columns["drive.k_s2"])


@pytest.mark.parametrize("first", ["plant.m3", "plant.m3.scale"])
def test_a_value_of_the_plant_and_a_factor_exclude_each_other(first: str) -> None:
    scenario = load_scenario("paper/nominal", {first: 1.5})
    at = [slot.key for slot in scenario.system().slots].index("plant.m3")
    two = np.array([1.1, 2.0])
    assert np.array_equal(scenario.values_for({"plant.m3": two})[:, at], two)
    assert np.array_equal(scenario.values_for({"plant.m3.scale": two})[:, at], 40.0 * two)
    assert np.array_equal(scenario.values_for({"plant.m3.scale": two, "plant.m3": two})[:, at], two)


def test_no_column_is_one_run() -> None:
    scenario = load_scenario("paper/nominal")
    assert np.array_equal(scenario.values_for({}), scenario.values()[None, :])


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        ({"control.lamda": [1.0]}, ["unknown numeric key", "'control.lambda'"]),
        ({"control.law": [1.0]}, ["unknown numeric key"]),
        ({"simulation.step": [1.0]}, ["unknown numeric key"]),
        ({"control.delta": [0.1, -0.1]}, ["control.delta", "run 1", "a number >= 0 [m or rad]", "got -0.1"]),
        ({"plant.m3": [1.0, math.nan]}, ["run 1", "got nan"]),
        ({"plant.m3": [math.inf]}, ["run 0", "got inf"]),
        ({"control.nu": [2.0, 3.0]}, ["run 1", "a positive even integer"]),
        ({"plant.m3.scale": [0.0]}, ["plant.m3.scale", "a number > 0"]),
        ({"control.delta": [0.1, 0.2], "control.k1": [1.0, 2.0, 3.0]}, ["control.k1", "as long as the others"]),
        ({"control.delta": [[0.1]]}, ["control.delta", "a column of numbers"]),
        ({"control.delta": ["a"]}, ["control.delta", "a column of numbers"]),
        ({"control.delta": [True]}, ["control.delta", "a column of numbers"]),
        ({"initial.q_motor.0": [0.0]}, ["initial.q_motor.0", "unknown numeric key"]),
    ],
)
def test_mistakes_in_columns_are_told(columns: dict[str, list[object]], expected: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        load_scenario("paper/nominal").values_for(columns)  # type: ignore[arg-type] # mistakes are meant
    assert all(part in str(caught.value) for part in expected), str(caught.value)


def test_value_of_is_what_the_run_uses() -> None:
    scenario = load_scenario("paper/group3_payload_plus")
    assert scenario.value_of("plant.m3") == 48.0
    assert scenario.value_of("plant.m2") == 10.0
    assert scenario.value_of("simulation.output_every") == 10
    assert scenario.number_of("plant.m3") == 48.0
    with pytest.raises(InputError, match=r"did you mean 'control\.delta'"):
        scenario.value_of("control.delt")
    with pytest.raises(TypeError, match=r"control\.law is 'variable_power_log', expected a number"):
        scenario.number_of("control.law")
    with pytest.raises(TypeError, match="expected a number"):
        scenario.number_of("control.fast")


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_columns_accept_exactly_what_files_accept(value: float) -> None:
    """A number that is within its parameter's bounds is accepted either way, any other is refused either way."""
    scenario = load_scenario("paper/nominal")
    for key in ("control.alpha", "control.a_max.0", "plant.m3", "mechanism.g", "control.nu", "control.beta"):
        bounds: Bounds = scenario.numeric_keys()[key].bounds
        for change in (
            lambda key=key: scenario.with_overrides({key: value}),
            lambda key=key: scenario.values_for({key: np.array([value])}),
        ):
            if bounds.holds(value):
                change()
            else:
                with pytest.raises(InputError):
                    change()


# TOML text


@given(
    st.recursive(
        st.booleans()
        | st.integers(-(2**63), 2**63 - 1)
        | st.floats(allow_nan=False)
        | st.text(st.characters(exclude_categories=["Cs"])),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(st.characters(exclude_categories=["Cs"])), inner),
        max_leaves=8,
    )
)
def test_what_is_written_is_read_back(value: object) -> None:
    assert tomllib.loads(f"value = {value_text(value)}")["value"] == value


def test_loading_is_quick() -> None:
    """No CasADi graph is built until it is asked for: a sweep may load scenarios by the hundred."""
    load_scenario("paper/group1_shake")
    start = time.perf_counter()
    for _ in range(20):
        load_scenario("paper/group1_shake", {"control.delta": 0.02})
    assert (time.perf_counter() - start) / 20 < 0.05
