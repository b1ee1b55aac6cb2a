"""A controller that remembers: its states are the same in batch, exported C and FMUs, sampled and continuous."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from arms import structure_of, values_of
from fmi_client import Client, client_library
from scipy.integrate import solve_ivp

from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.export.fmu import Settings, fmu
from springline.codegen.files import write_tree
from springline.codegen.kernel import METRICS, KernelOptions, KernelSpec, LoopSettings, Runs, kernel
from springline.model.control import CONTROLLERS, ArmModel, Control, Controller
from springline.model.parameters import NON_NEGATIVE, POSITIVE, Parameter, Values
from springline.model.quantities import SIGMA, Quantity
from springline.model.structure import Structure
from springline.model.system import System

pytestmark = pytest.mark.usefixtures("other_arms")

STEP, STEPS, HOLD = 1e-4, 400, 10
XI = Quantity("xi", r"\xi", "{q} s", "integral of the error", initial=0.01)


class IntegralAction(Controller):
    """Computed torque with an integral that winds up no further than the limit lets it; no sliding variable."""

    parameters = (
        Parameter("bandwidth", "1/s", 6.0, "of the error", POSITIVE, per_joint=True),
        Parameter("unwinding", "{q}/{F}", 1e-3, "of the integral by what U_max takes away", NON_NEGATIVE),
    )
    states = (XI,)

    def control(self, r: Values, y: Values, z: Values, model: ArmModel, p: Values) -> Control:
        arm, w, e = model(y.q1, y.dq1), p.bandwidth, r.q - y.q1
        u = arm.H @ (r.ddq + 3 * w * (r.dq - y.dq1) + 3 * w**2 * e + w**3 * z.xi) + arm.c + arm.G
        return Control(u, e, lambda limited: {"xi": e + p.unwinding * (limited - u)})


Update = Callable[[ca.SX], dict[str, ca.SX]]


class IntegralSurface(Controller):
    """A surface with an integral, two states of which one is a scalar, and an update of its own for samples."""

    title = "integral sliding surface"
    states = (XI, Quantity("effort", "E", "N^2 s", "forgetful integral of the squared command", per="scalar"))
    diagnostics = (SIGMA,)

    def control(self, r: Values, y: Values, z: Values, model: ArmModel, p: Values) -> Control:
        arm, e, de = model(y.q1, y.dq1), r.q - y.q1, r.dq - y.dq1
        sigma = de + 10 * e + 25 * z.xi
        u = arm.H @ (r.ddq + 10 * de + 25 * e + 10 * sigma / ca.sqrt(1 + sigma**2)) + arm.c + arm.G
        return Control(u, e, {"effort": ca.dot(u, u) - z.effort, "xi": e}, {"sigma": sigma})

    def update(self, r: Values, y: Values, z: Values, model: ArmModel, p: Values, h: ca.SX) -> Update:
        return lambda u: {"xi": z.xi + h * (r.q - y.q1), "effort": z.effort * ca.exp(-h) + h * ca.dot(u, u)}


@pytest.fixture(autouse=True)
def _own_controllers(monkeypatch: pytest.MonkeyPatch) -> None:
    for controller in (IntegralAction(), IntegralSurface()):
        monkeypatch.setitem(CONTROLLERS, controller.name, controller)


CASES = [
    ("transfer_manipulator", "integral_action", "rk4", "elastic"),
    ("one_link", "integral_surface", "dop853", "rigid"),
    ("three_links", "integral_action", "midpoint", "rigid"),
    ("three_links", "integral_surface", "rk4", "elastic"),
]
cases = pytest.mark.parametrize(("mechanism", "controller", "integrator", "drive"), CASES)


def case(mechanism: str, controller: str, integrator: str = "rk4", drive: Any = "elastic") -> Structure:
    return structure_of(mechanism, controller=controller, integrator=integrator, drive=drive)


def numbers(structure: Structure, **changes: float) -> np.ndarray:
    """U_max low enough to limit now and then, other numbers as they come."""
    slots = System(structure).slots
    values = values_of(structure)
    for i, slot in enumerate(slots):
        if slot.key.startswith("control.U_max"):
            values[i] = {"transfer_manipulator": 900.0}.get(structure.mechanism, 12.0)
        values[i] = changes.get(slot.key.replace(".", "_"), values[i])
    return values


def run(structure: Structure, sampled: bool, values: np.ndarray, every: int = 3, **options: Any) -> Runs:
    loop = kernel(KernelSpec(structure, sampled, options=KernelOptions(**options)))
    return loop.run(np.atleast_2d(values), LoopSettings(STEPS, STEP, hold=HOLD, output_every=every))


def names_of(structure: Structure) -> list[str]:
    return [entry.name for entry in System(structure).trajectory]


def column(structure: Structure, rows: np.ndarray, name: str) -> np.ndarray:
    return rows[:, names_of(structure).index(name)]


# --- the loop --------------------------------------------------------------------------------------------


@cases
@pytest.mark.parametrize("sampled", [True, False])
def test_all_kernels_have_the_same_bits(
    mechanism: str, controller: str, integrator: str, drive: str, sampled: bool
) -> None:
    structure = case(mechanism, controller, integrator, drive)
    values = np.array([numbers(structure, initial_q_0=0.1 * k) for k in range(5)])
    reference = run(structure, sampled, values, engine="casadi")
    assert (reference.status == 0).all()
    for width, groups, packs in ((1, 1, 1), (2, 1, 2), (4, 2, 1)):
        runs = run(structure, sampled, values, width=width, groups=groups, packs=packs)
        np.testing.assert_array_equal(runs.trajectory, reference.trajectory)
        np.testing.assert_array_equal(runs.metrics, reference.metrics)
        np.testing.assert_array_equal(runs.final_state, reference.final_state)
    keys = [slot.key for slot in System(structure).slots]
    own = [key for key in keys if key.startswith(("control.integral", "initial.q.0"))]
    baked = kernel(KernelSpec(structure, sampled, tuple(own), tuple(values[0]), KernelOptions(width=4)))
    columns = values[:, [keys.index(key) for key in baked.parameters]]
    runs = baked.run(columns, LoopSettings(STEPS, STEP, hold=HOLD, output_every=3))
    np.testing.assert_array_equal(runs.trajectory, reference.trajectory)


def test_states_have_columns_units_and_a_place_in_the_final_state() -> None:
    structure = case("transfer_manipulator", "integral_surface")
    system = System(structure)
    names = names_of(structure)
    at = names.index("z_xi_lift")
    assert names[at - 1 : at + 4] == ["U_rotation", "z_xi_lift", "z_xi_rotation", "z_effort", "y_r1"]
    assert [entry.unit for entry in system.trajectory][at : at + 3] == ["m s", "rad s", "N^2 s"]
    runs = run(structure, True, numbers(structure))
    rows = runs.trajectory[0]
    np.testing.assert_array_equal(rows[0, at : at + 3], [0.01, 0.01, 0.0])
    np.testing.assert_array_equal(runs.final_state[0], [*rows[-1, 1:9], *rows[-1, at : at + 3]])
    without = case("transfer_manipulator", "integral_action")
    assert not [name for name in names_of(without) if name.startswith("sigma")]
    metrics = run(without, True, numbers(without)).metrics[0]
    assert np.isnan(metrics[:, METRICS.index("sigma_tv")]).all()
    assert np.isfinite(metrics[:, METRICS.index("U_max")]).all()


def test_sampled_states_go_on_by_explicit_euler_once_a_sample() -> None:
    """A row at a sample has the states that its command was computed from; after it come those of the next."""
    structure = case("transfer_manipulator", "integral_action")
    values = numbers(structure, control_integral_action_unwinding=0.0)
    rows = run(structure, True, values, every=1).trajectory[0]
    xi, e = column(structure, rows, "z_xi_lift"), column(structure, rows, "e_lift")
    expected = 0.01
    for k in range(0, STEPS, HOLD):
        assert xi[k] == expected
        expected = expected + HOLD * STEP * e[k]
        assert (xi[k + 1 : k + HOLD] == expected).all()


def test_an_update_takes_the_place_of_euler_s_step() -> None:
    structure = case("transfer_manipulator", "integral_surface")
    rows = run(structure, True, numbers(structure), every=HOLD).trajectory[0]
    effort = column(structure, rows, "z_effort")
    squared = column(structure, rows, "U_lift") ** 2 + column(structure, rows, "U_rotation") ** 2
    np.testing.assert_allclose(effort[1:], effort[:-1] * np.exp(-HOLD * STEP) + HOLD * STEP * squared[:-1], rtol=1e-14)


def test_what_u_max_takes_away_unwinds_the_integral() -> None:
    structure = case("transfer_manipulator", "integral_action")
    free, limited = (
        column(structure, run(structure, False, numbers(structure, control_U_max_0=limit)).trajectory[0], "z_xi_lift")
        for limit in (np.inf, 850.0)
    )
    assert np.max(np.abs(free - limited)) > 1e-3


@pytest.mark.parametrize(("mechanism", "drive"), [("transfer_manipulator", "elastic"), ("slider", "elastic")])
def test_continuous_states_are_those_of_the_differential_equation(mechanism: str, drive: Any) -> None:
    """scipy integrates plant and controller together, from the model's Functions for people."""
    structure = case(mechanism, "integral_action", "dop853", drive)
    system, values = System(structure), numbers(structure, control_U_max_0=np.inf, control_U_max_1=np.inf)
    n, x_size = system.n, system.x.numel()

    def flow(t: float, at: np.ndarray) -> np.ndarray:
        w = np.array(system.function("signals")(t, [], values)).ravel()
        r, base = np.split(w[: 3 * n], 3), np.split(w[3 * n :], 3)
        x, z = at[:x_size], at[x_size:]
        u = system.function("control")(*r, x, z, values)[0]
        dz = system.function("rates")(*r, x, z, values)
        return np.concatenate([np.array(system.function("plant")(*base, x, u, values)).ravel(), np.array(dz).ravel()])

    start = np.concatenate([np.array(system.function("start")(0.0, [], values)).ravel(), system.z_start])
    end = solve_ivp(flow, (0.0, STEPS * STEP), start, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    mine = run(structure, False, values).final_state[0]
    np.testing.assert_allclose(mine, end, rtol=1e-8, atol=1e-10)
    assert np.all(np.abs(end[x_size:] - 0.01) > 1e-5)


def test_a_state_that_runs_away_is_named() -> None:
    structure = case("transfer_manipulator", "integral_surface")
    loop = kernel(KernelSpec(structure, True, options=KernelOptions(width=4)))
    names = names_of(structure)
    settings = LoopSettings(STEPS, STEP, bound=2000.0, hold=HOLD)
    runs = loop.run(numbers(structure)[None], settings)
    assert runs.status[0] == 2
    assert names[1 + runs.quantity[0]] == "z_effort"
    assert 0.0 < abs(runs.final_state[0, -1]) <= 2000.0


# --- what a controller may not do ------------------------------------------------------------------------


def broken(**attributes: Any) -> str:
    """The message about a controller whose class differs from IntegralAction in these attributes."""
    cls = type("Broken", (IntegralAction,), attributes)
    CONTROLLERS["broken"] = cls()
    try:
        with pytest.raises(ValueError, match="controller broken: ") as error:
            _ = System(case("transfer_manipulator", "broken")).functions
        return str(error.value).removeprefix("controller broken: ")
    finally:
        del CONTROLLERS["broken"]


def gives(*, u: Any = None, error: Any = None, dz: Any = None, diagnostics: Any = None) -> Any:
    """A method `control` that gives something else in some place."""

    def control(self: Controller, r: Values, y: Values, z: Values, model: ArmModel, p: Values) -> Control:
        e = r.q - y.q1
        chosen = {"u": u, "error": error, "dz": dz, "diagnostics": diagnostics}
        return replace(Control(e, e, {"xi": e}), **{k: v for k, v in chosen.items() if v is not None})

    return control


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"control": gives(dz={})}, "dz has no 'xi', expected 2 x 1 for this state"),
        ({"control": gives(dz=lambda u: {})}, "dz has no 'xi', expected 2 x 1 for this state"),
        ({"control": gives(dz={"xi": ca.SX(1)})}, "dz of 'xi' has shape 1 x 1, expected 2 x 1"),
        ({"control": gives(dz={"xi": ca.SX(2, 1), "eta": 1})}, "dz has 'eta', expected xi"),
        ({"update": lambda self, *given: {}}, "update has no 'xi', expected 2 x 1 for this state"),
        ({"update": lambda self, *given: {"xi": ca.SX(2, 2)}}, "update of 'xi' has shape 2 x 2, expected 2 x 1"),
        ({"control": gives(u=ca.SX(3, 1))}, "u has shape 3 x 1, expected 2 x 1"),
        ({"control": gives(error=ca.SX(1, 2))}, "error has shape 1 x 2, expected 2 x 1"),
        ({"control": gives(diagnostics={"sigma": 1})}, "diagnostics has 'sigma', expected nothing"),
        ({"diagnostics": (SIGMA,)}, "diagnostics has no 'sigma', which the class declares"),
        (
            {
                "diagnostics": (Quantity("U_i", "U_i", "{F}", "part"),),
                "control": gives(diagnostics={"U_i": ca.SX.ones(2)}),
            },
            "u is not U_i, the parts that diagnostics has",
        ),
    ],
)
def test_a_controller_that_is_incomplete_is_told_where(attributes: dict[str, Any], message: str) -> None:
    assert broken(**attributes) == message


# --- exported C ------------------------------------------------------------------------------------------

WARNINGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-O1", "-ffp-contract=off"]


def export(structure: Structure, folder: Path, **options: Any) -> None:
    write_tree(folder, *generate_files(bind(structure, numbers(structure), prefix="arm", **options)))


def built(folder: Path, *sources: str) -> Path:
    program, includes = folder / "program", [f"-I{folder}/include", f"-I{folder}/src"]
    subprocess.run(["cc", *WARNINGS, *includes, *(folder / source for source in sources), "-o", program], check=True)
    return program


@cases
def test_exported_c_checks_itself_and_runs_as_the_loop(
    mechanism: str, controller: str, integrator: str, drive: str, tmp_path: Path
) -> None:
    structure = case(mechanism, controller, integrator, drive)
    export(structure, tmp_path, tunable=["control"], period=HOLD * STEP)
    check = built(tmp_path, "src/arm.c", "src/arm_model.c", "self_check.c")
    done = subprocess.run([check, tmp_path / "test_vectors.txt"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    printed = subprocess.run(
        [built(tmp_path, "src/arm.c", "main.c"), "1"], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    header, rows = printed[0].split(","), np.array([[float(word) for word in line.split(",")] for line in printed[1:]])
    names = names_of(structure)
    own = run(structure, True, numbers(structure), every=100).trajectory[0][:, [names.index(name) for name in header]]
    np.testing.assert_array_equal(rows[: len(own), 1:], own[:, 1:])


@pytest.mark.parametrize("controller", ["integral_action", "integral_surface"])
def test_in_single_precision_it_checks_itself_too(controller: str, tmp_path: Path) -> None:
    structure = case("three_links", controller)
    export(structure, tmp_path, real="float")
    check = built(tmp_path, "src/arm.c", "src/arm_model.c", "self_check.c")
    assert subprocess.run([check, tmp_path / "test_vectors.txt"], check=False).returncode == 0


def test_self_check_sees_a_state_that_is_not_kept(tmp_path: Path) -> None:
    export(case("one_link", "integral_action"), tmp_path)
    source = tmp_path / "src" / "arm.c"
    text = source.read_text()
    kept = "    controller->z = ahead;\n"
    assert text.count(kept) == 1
    source.write_text(text.replace(kept, ""))
    check = built(tmp_path, "src/arm.c", "src/arm_model.c", "self_check.c")
    done = subprocess.run([check, tmp_path / "test_vectors.txt"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "z_xi_elbow of springline_step" in done.stdout.replace("arm_step", "springline_step")


def test_states_of_the_exported_controller(tmp_path: Path) -> None:
    """init and reset begin anew, set_parameters keeps, a sample that fails changes nothing."""
    export(case("one_link", "integral_action"), tmp_path, tunable=["control"])
    (tmp_path / "life.c").write_text(r"""
#include <stdio.h>
#include "arm.h"
#include "sl_math.h"

static arm_controller controller;
static arm_reference reference;
static arm_measurement measurement;
static arm_command command;

static void show(const char *what, int status) {
  printf("%s %d %.17g\n", what, status, controller.z.z_xi_elbow);
}

static int sample(void) { return arm_step(&controller, &reference, &measurement, &command, NULL); }

int main(void) {
  arm_config config = arm_default_config;
  reference.q1d_elbow = 0.1;
  show("init", arm_init(&controller, &config));
  show("step", sample());
  show("step", sample());
  config.parameters.control_integral_action_bandwidth_elbow = 7.0;
  show("set", arm_set_parameters(&controller, &config));
  config.parameters.control_integral_action_bandwidth_elbow = -7.0;
  show("refused", arm_set_parameters(&controller, &config));
  measurement.q1_elbow = SL_NAN;
  show("nan", sample());
  measurement.q1_elbow = 1e308;
  show("overflow", sample());
  measurement.q1_elbow = 0.0;
  show("step", sample());
  show("reset", arm_reset(&controller));
  show("step", sample());
  return 0;
}
""")
    program = built(tmp_path, "src/arm.c", "life.c")
    lines = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
    seen = [(line.split()[0], int(line.split()[1]), float(line.split()[2])) for line in lines]
    one, two, three = 0.01 + 1e-3 * 0.1, 0.01 + 1e-3 * 0.1 + 1e-3 * 0.1, 0.01 + 1e-3 * 0.1 + 1e-3 * 0.1 + 1e-3 * 0.1
    expected = [("init", 0, 0.01), ("step", 0, one), ("step", 0, two), ("set", 0, two), ("refused", 4, two)]
    expected += [("nan", 6, two), ("overflow", 7, two), ("step", 0, three), ("reset", 0, 0.01), ("step", 0, one)]
    assert seen == expected


def test_the_header_says_the_period(tmp_path: Path) -> None:
    export(case("one_link", "integral_action"), tmp_path, period=0.004)
    header = (tmp_path / "include" / "arm.h").read_text()
    assert "moves the controller's states on by 0.004 s" in header
    assert "z_xi_elbow; /* rad s; integral of the error (elbow) */" in header
    assert "keeps no state" not in header + (tmp_path / "README.md").read_text()
    with pytest.raises(ValueError, match="period is 0"):
        export(case("one_link", "integral_action"), tmp_path / "other", period=0.0)


# --- FMUs ------------------------------------------------------------------------------------------------


def made(structure: Structure, part: Any, version: Any, sampled: bool, folder: Path) -> Path:
    settings = Settings(duration=STEPS * STEP, step=STEP, period=HOLD * STEP if sampled else 0.0)
    name = f"{part}{version}{int(sampled)}"
    content = fmu(structure, numbers(structure), settings, part=part, version=version, identifier=name, name=name)
    path = folder / f"{name}.fmu"
    path.write_bytes(content)
    return path


def driven(client: Client, names: list[str], first: int, last: int, every: int) -> np.ndarray:
    """Rows from step `first` to `last`, both inclusive."""
    rows = [client.get(names)]
    for k in range(first, last, every):
        client.step(k * STEP, every * STEP)
        rows.append(client.get(names))
    return np.array(rows)


@cases
@pytest.mark.parametrize("sampled", [True, False])
def test_the_loop_in_an_fmu_is_the_loop(
    mechanism: str, controller: str, integrator: str, drive: str, sampled: bool, tmp_path: Path
) -> None:
    structure = case(mechanism, controller, integrator, drive)
    version = 2 if sampled == (drive == "rigid") else 3
    path = made(structure, "loop", version, sampled, tmp_path)
    assert client_library("fmpy.validation").validate_fmu(str(path)) == []
    client, names = Client(path, tmp_path).start(), names_of(structure)[1:]
    rows = driven(client, names, 0, STEPS, 5)  # half a sample
    np.testing.assert_array_equal(rows, run(structure, sampled, numbers(structure), every=5).trajectory[0][:, 1:])
    local = [v for v in client.description.modelVariables if v.causality == "local"]
    assert [v.name for v in local] == [name for name in names if name.startswith("z_")]
    assert {v.variability for v in local} == {"discrete" if sampled else "continuous"}
    client.slave.freeInstance()


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("sampled", [True, False])
def test_saved_and_serialised_states_carry_z(version: int, sampled: bool, tmp_path: Path) -> None:
    structure = case("one_link", "integral_action")
    path = made(structure, "loop", version, sampled, tmp_path)
    names = [name for name in names_of(structure)[1:] if name.startswith(("q1_", "U_", "z_"))]
    client = Client(path, tmp_path).start()
    driven(client, names, 0, 15, 5)  # between two samples
    state = client.slave.getFMUState()
    data = client.slave.serializeFMUState(state)
    onwards = driven(client, names, 15, 60, 5)
    client.slave.setFMUState(state)
    np.testing.assert_array_equal(driven(client, names, 15, 60, 5), onwards)
    other = Client(path, tmp_path)
    foreign = other.slave.deserializeFMUState(data)
    other.slave.setFMUState(foreign)
    np.testing.assert_array_equal(driven(other, names, 15, 60, 5), onwards)
    other.slave.reset()
    np.testing.assert_array_equal(other.start().get(["z_xi_elbow"]), [0.01])
    for instance, kept in ((client, state), (other, foreign)):
        instance.slave.freeFMUState(kept)
        instance.slave.freeInstance()


def test_outputs_may_be_asked_for_again_and_parameters_set_at_a_sample(tmp_path: Path) -> None:
    """Neither moves the controller's states on: only time does."""
    structure = case("one_link", "integral_action")
    client = Client(made(structure, "loop", 3, True, tmp_path), tmp_path).start()
    key, names = "control.integral_action.bandwidth.0", ["z_xi_elbow", "U_elbow"]
    client.step(0.0, HOLD * STEP)
    seen = client.get(names)
    [gain] = client.get([key])
    for value in (2 * gain, gain):
        client.set([key], [value])
        assert (client.get(names) == seen) == (value == gain)
        assert client.get(names)[0] == seen[0]
    with pytest.raises(Exception, match="fmi3"):
        client.set(["z_xi_elbow"], [0.0])
    assert "neither a parameter nor an input" in client.messages[-1]
    expected = run(structure, True, numbers(structure), every=HOLD).trajectory[0]
    client.step(HOLD * STEP, HOLD * STEP)
    at = [names_of(structure).index(name) for name in names]
    np.testing.assert_array_equal(client.get(names), expected[2, at])
    client.slave.freeInstance()


@pytest.mark.parametrize(("version", "sampled"), [(2, True), (3, True), (3, False)])
def test_the_controller_as_an_fmu_samples_as_the_exported_step(version: int, sampled: bool, tmp_path: Path) -> None:
    """Over several samples at once too; without a sample period it samples at the scenario's step."""
    structure = case("one_link", "integral_action")
    system, values = System(structure), numbers(structure)
    path = made(structure, "controller", version, sampled, tmp_path)
    assert client_library("fmpy.validation").validate_fmu(str(path)) == []
    period = HOLD * STEP if sampled else STEP
    client = Client(path, tmp_path).start()
    inputs = ["q1d_elbow", "dq1d_elbow", "ddq1d_elbow", "q1_elbow", "dq1_elbow"]
    z, k = np.array(system.z_start), 0
    for samples, given in ((1, [0.1, 0.2, 0.3, 0.05, 0.0]), (3, [0.2, 0.0, 0.0, 0.1, 0.3]), (2, [-0.1, 0, 0, 0, 0])):
        client.set(inputs, given)
        r, x = given[:3], [*given[3:], 0.0, 0.0]
        u = system.function("control")(*r, x, z, values)[0]
        np.testing.assert_allclose(client.get(["U_elbow", "z_xi_elbow"]), [float(u), z[0]], rtol=1e-14)
        client.step(k * period, samples * period)
        k += samples
        for _ in range(samples):
            z = np.array(system.function("update")(*r, x, z, period, values)).ravel()
    np.testing.assert_allclose(client.get(["z_xi_elbow"]), z, rtol=1e-14)
    client.slave.freeInstance()


def test_the_plant_alone_has_no_states_of_a_controller(tmp_path: Path) -> None:
    path = made(case("one_link", "integral_action"), "plant", 3, True, tmp_path)
    client = Client(path, tmp_path).start()
    assert not [name for name in client.references if name.startswith("z_")]
    client.slave.freeInstance()
