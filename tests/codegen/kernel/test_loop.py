"""The compiled loop: order, accuracy, sampling, signals, metrics, divergence, threads."""

import ctypes
import math
import threading
from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import trapezoid

from springline.codegen.kernel import (
    METRICS,
    MOST_STEPS,
    STATUS,
    Kernel,
    KernelOptions,
    KernelSpec,
    LoopSettings,
    Runs,
    Watch,
    quantity_name,
    toolchain,
)
from springline.codegen.kernel import compiled as kernel_module
from springline.codegen.kernel import metrics as kernel_metrics
from springline.codegen.kernel import source as kernel_source
from springline.codegen.kernel.compiled import LayoutError, compile_kernel
from springline.codegen.kernel.job import JOB, Job
from springline.codegen.program import Program, SignalTable, program
from springline.model import metrics
from springline.model.structure import SignalShape, Structure
from springline.model.symbolic import as_written

Values = Callable[..., NDArray[np.float64]]
# Low levels of optimisation, for they change no bit: test_engines.py compares them with all others.
PLAIN = KernelOptions(width=1, groups=1, flags=("-O1",))
WIDE = KernelOptions(width=4, groups=2, flags=("-O0",))
CASADI = KernelOptions("casadi", flags=("-O0",))


def with_plant(base: Program, right_hand_side: Callable[[ca.SX], ca.SX]) -> Program:
    """The loop around another plant dx = f(x)."""
    old = base.functions["plant"]
    inputs = old.sx_in()
    names = [old.name_in(i) for i in range(old.n_in())]
    with as_written():
        plant = ca.Function(old.name(), inputs, [ca.densify(right_hand_side(inputs[2]))], names, ["dx"])
    return Program(base.system, {**base.functions, "plant": plant})


def compiled(base: Program, *, sampled: bool = False, options: KernelOptions = PLAIN) -> Kernel:
    return compile_kernel(base, KernelSpec(base.system.structure, sampled, options=options))


def run(
    base: Program,
    values: NDArray[np.float64],
    settings: LoopSettings,
    *,
    sampled: bool = False,
    tables: tuple[SignalTable, ...] = (),
    options: KernelOptions = PLAIN,
) -> Runs:
    return compiled(base, sampled=sampled, options=options).run(np.atleast_2d(values), settings, tables)


@pytest.mark.parametrize("sampled", [False, True])
def test_rk4_has_order_four(sampled: bool, shaken: Program, values_of: Values) -> None:
    """Four undamped oscillators against cos and sin; order by regression over step sizes."""
    omega = np.array([1.0, 2.0, 3.0, 5.0])
    rotating = with_plant(
        shaken, lambda x: ca.vertcat(*(e for i, w in enumerate(omega) for e in (w * x[2 * i + 1], -w * x[2 * i])))
    )
    values = values_of(shaken)
    kernel = compiled(rotating, sampled=sampled)
    start = kernel.run(values[None, :], LoopSettings(0, 1.0)).final_state[0]
    angle = np.exp(-1j * omega * 2.0) * (start[0::2] + 1j * start[1::2])
    exact = np.stack([angle.real, angle.imag], axis=1).ravel()
    steps = np.array([40, 80, 160, 320, 640])
    errors = [
        np.abs(kernel.run(values[None, :], LoopSettings(int(n), 2.0 / n)).final_state[0] - exact).max() for n in steps
    ]
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 3.8 < order < 4.2


def test_closed_loop_agrees_with_cvodes(values_of: Values) -> None:
    """The nominal run, no base motion, against CVODES at reltol 1e-10: positions, angles and link rates to 1e-5.

    Motor rates follow the springs' vibration, which the limiter's corners excite: there 1e-2 holds.
    """
    still = program(Structure())
    values = values_of(still)
    system = still.system
    t, x = ca.SX.sym("t"), ca.SX.sym("x", 8)
    w = system.function("signals")(t, ca.SX(0, 1), values)
    u, *_ = system.function("loop_control")(w, x, values)
    ode = system.function("loop_plant")(w, x, u, values)
    times = np.linspace(0.0, 4.0, 9)
    cvodes = ca.integrator(
        "cvodes",
        "cvodes",
        {"t": t, "x": x, "ode": ode},
        0.0,
        times[1:].tolist(),
        {"reltol": 1e-10, "abstol": 1e-12, "max_num_steps": 2_000_000},
    )
    start = system.function("start")(0.0, ca.DM(0, 1), values)
    expected = np.array(cvodes(x0=start)["xf"]).T
    result = run(still, values, LoopSettings(40000, 1e-4, output_every=5000))
    assert result.trajectory is not None
    actual = result.trajectory[0, 1:, 1:9]
    error = np.abs(actual - expected).max(axis=0)
    assert error[[0, 1, 4, 5]].max() < 1e-5
    assert error[[2, 3]].max() < 1e-4
    assert error[[6, 7]].max() < 1e-2


def metrics_by_hand(rows: NDArray[np.float64], joint: int, settings: LoopSettings) -> dict[str, float]:
    """The definitions of model/metrics.py on a trajectory with every step."""
    t, e, sigma, u, rate = rows[:, 0], rows[:, 11 + joint], rows[:, 13 + joint], rows[:, 15 + joint], rows[:, 3 + joint]
    size, start, late = np.abs(e), abs(e[0]), 4 * np.arange(len(t)) >= 3 * settings.steps
    inside = np.flatnonzero(size <= settings.response_band * start + settings.response_error)
    outside = np.flatnonzero(size > settings.settling_band * start + settings.settling_error)
    last = outside[-1]
    settled = t[last] <= 0.98 * t[-1]
    second = u[settings.steps // 2 :]
    half = (settings.steps - settings.steps // 2) * settings.step
    scale = max(second.max() - second.min(), 1e-3 * np.abs(u).max())
    return {
        "response_time": t[inside[0]],
        "settling_time": t[last] if settled else math.nan,
        "overshoot": max(0.0, (-e * np.sign(e[0])).max()),
        "steady_state_error": size[late].max(),
        "rms_error": math.sqrt(trapezoid(e**2, t) / (t[-1] - t[0])),
        "iae": trapezoid(size, t),
        "U_max": np.abs(u).max(),
        "U_rms": math.sqrt(trapezoid(u**2, t) / (t[-1] - t[0])),
        "chatter": np.abs(np.diff(second)).sum() / half / scale,
        "U_tv": np.abs(np.diff(u[last:])).sum() if settled else math.nan,
        "sigma_tv": np.abs(np.diff(sigma[last:])).sum() if settled else math.nan,
        "dq1_tv": np.abs(np.diff(rate[last:])).sum() if settled else math.nan,
    }


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("steps", [8000, 8001])
def test_metrics_follow_their_definitions(steps: int, sampled: bool, shaken: Program, values_of: Values) -> None:
    settings = LoopSettings(steps, 1e-4, hold=4, output_every=1)
    result = run(shaken, values_of(shaken), settings, sampled=sampled)
    assert result.trajectory is not None
    for joint in range(2):
        expected = metrics_by_hand(result.trajectory[0], joint, settings)
        for k, name in enumerate(METRICS):
            assert result.metrics[0, joint, k] == pytest.approx(expected[name], rel=1e-9), name


def test_absolute_bands_judge_a_run_that_starts_on_its_reference(shaken: Program, values_of: Values) -> None:
    """Fractions of e(0) = 0 are no bands; errors in SI units are, and overshoot has no side to be on."""
    on_reference = {"initial.q.0": 0.0, "initial.q.1": 1.0, "initial.dq.0": math.pi, "initial.dq.1": math.pi / 2}
    settings = LoopSettings(8000, 1e-4, output_every=1)
    absolute = replace(settings, response_band=0.0, settling_band=0.0, response_error=2e-3, settling_error=1e-3)
    relative, result = (run(shaken, values_of(shaken, on_reference), each) for each in (settings, absolute))
    assert result.trajectory is not None
    for joint in range(2):
        by_name = dict(zip(METRICS, relative.metrics[0, joint], strict=True))
        assert all(math.isnan(by_name[name]) for name in ("response_time", "settling_time", "overshoot", "U_tv"))
        expected = metrics_by_hand(result.trajectory[0], joint, absolute)
        found = dict(zip(METRICS, result.metrics[0, joint], strict=True))
        assert math.isnan(found["settling_time"]) == (joint == 0), (
            "the lift is 5 mm off at the end, the rotation settles"
        )
        assert math.isnan(found.pop("overshoot"))
        assert found["response_time"] == 0.0
        for name, value in found.items():
            np.testing.assert_allclose(value, expected[name], rtol=1e-9, err_msg=name)


def motion(base: Program, accelerations: Callable[[ca.SX, ca.SX], ca.SX]) -> Program:
    """The loop around motors at rest and links that move as the 2 x 1 `accelerations`(q1, dq1) say."""
    return with_plant(base, lambda x: ca.vertcat(x[2:4], accelerations(x[:2], x[2:4]), ca.SX.zeros(4)))


STILL = {f"reference.{key}": 0.0 for key in ("lift.terms.0.amplitude", "rotation.terms.0.amplitude", "rotation.offset")}


@pytest.mark.parametrize("start", [0.0, 30.0])
def test_a_run_has_settled_if_it_did_before_its_last_fiftieth(start: float, shaken: Program, values_of: Values) -> None:
    """e decays to its band of 5 % at 97.5 % of the run on the lift, at 98.5 % on the rotation."""
    duration, shares = 2.0, (0.975, 0.985)
    rates = ca.DM([math.log(20.0) / (share * duration) for share in shares])
    decaying = with_plant(shaken, lambda x: ca.vertcat(-rates * x[:2], ca.SX.zeros(6)))
    settings = LoopSettings(2000, duration / 2000, start_time=start)
    result = run(decaying, values_of(shaken, STILL), settings)
    lift, rotation = (dict(zip(METRICS, result.metrics[0, j], strict=True)) for j in range(2))
    assert lift["settling_time"] == pytest.approx(start + shares[0] * duration, abs=2 * settings.step)
    assert lift["dq1_tv"] == 0.0
    assert all(math.isnan(rotation[name]) for name in ("settling_time", "U_tv", "sigma_tv", "dq1_tv"))
    assert rotation["response_time"] == pytest.approx(
        start + shares[1] * duration * math.log(10.0) / math.log(20.0), abs=2 * settings.step
    )


def test_variation_counts_from_the_last_time_outside_the_band(shaken: Program, values_of: Values) -> None:
    """Of damped swings that leave the band again and again, the last departure is what settling ends with."""
    swinging = motion(shaken, lambda q, dq: -(ca.DM([20.0, 14.0]) ** 2) * q - ca.DM([3.0, 2.0]) * dq)
    settings = LoopSettings(40_000, 1e-4, output_every=1)
    result = run(swinging, values_of(shaken, STILL), settings)
    assert result.trajectory is not None
    for joint in range(2):
        rows = result.trajectory[0]
        outside = np.abs(rows[:, 11 + joint]) > settings.settling_band * abs(rows[0, 11 + joint])
        assert np.count_nonzero(np.diff(outside.astype(int)) == 1) > 5, "it leaves the band again"
        expected = metrics_by_hand(rows, joint, settings)
        assert expected["sigma_tv"] < 0.2 * np.abs(np.diff(rows[:, 13 + joint])).sum()
        for name in ("settling_time", "U_tv", "sigma_tv", "dq1_tv"):
            assert result.metrics[0, joint, METRICS.index(name)] == pytest.approx(expected[name], rel=1e-9), name


def test_chatter_is_the_rate_of_full_swings(shaken: Program, values_of: Values) -> None:
    """A command that swings f times a second from end to end and back has 2 f; one that stands still has 0.

    The lift's motor swings by itself; K_f makes that the command, against which the rest of it is nothing.
    """
    swings = 13.0
    w = 2.0 * math.pi * swings
    values = values_of(shaken, {**STILL, "initial.dq.0": 0.0, "control.K_f.0": 1e9, "control.K_f.1": 0.0})
    swinging = with_plant(shaken, lambda x: ca.vertcat(ca.SX.zeros(4), w * x[6], ca.SX(0), -w * x[4], ca.SX(0)))
    result = run(swinging, values, LoopSettings(20_000, 1e-4))
    lift, rotation = result.metrics[0, :, METRICS.index("chatter")]
    assert lift == pytest.approx(2.0 * swings, rel=2e-3)
    assert rotation == 0.0


def test_ripple_far_below_the_largest_command_is_no_chatter(shaken: Program, values_of: Values) -> None:
    """Swings of 30 Hz that are damped to 6e-6 of their size when the second half begins."""
    w, damping = 2.0 * math.pi * 30.0, 12.0
    values = values_of(shaken, {**STILL, "initial.dq.0": 0.0, "control.K_f.0": 1e9, "control.K_f.1": 0.0})
    damped = with_plant(
        shaken,
        lambda x: ca.vertcat(ca.SX.zeros(4), w * x[6] - damping * x[4], ca.SX(0), -w * x[4] - damping * x[6], ca.SX(0)),
    )
    settings = LoopSettings(20_000, 1e-4, output_every=1)
    result = run(damped, values, settings)
    assert result.trajectory is not None
    chatter = result.metrics[0, 0, METRICS.index("chatter")]
    u = result.trajectory[0, :, 15]
    assert np.ptp(u[10_000:]) < 1e-4 * np.abs(u).max()
    assert chatter == pytest.approx(np.abs(np.diff(u[10_000:])).sum() / 1.0 / (1e-3 * np.abs(u).max()), rel=1e-9)
    assert chatter < 1.0


def test_iae_of_a_run_that_stops_ends_where_it_does(shaken: Program, values_of: Values) -> None:
    """e grows at 3 m/s, so that its integral up to t is known; a step has a quarter of it."""
    values = values_of(shaken, {**STILL, "initial.q.0": 1.0})
    growing = with_plant(shaken, lambda x: ca.vertcat(ca.SX(3.0), ca.SX.zeros(7)))
    result = run(growing, values, LoopSettings(100, 0.1, bound=2.4))
    assert STATUS[result.status[0]] == "out_of_bounds"
    end = result.end_time[0]
    assert end == pytest.approx(0.4)
    assert result.metrics[0, 0, METRICS.index("iae")] == pytest.approx(end + 3.0 * end**2 / 2, rel=1e-12)
    assert math.isnan(result.metrics[0, 0, METRICS.index("chatter")])


def test_metrics_that_do_not_exist_are_nan(shaken: Program, values_of: Values) -> None:
    """e(0) = 0 on the rotation; a run too short to respond on the lift."""
    result = run(shaken, values_of(shaken, {"initial.q.1": 1.0}), LoopSettings(100, 1e-4))
    lift, rotation = (dict(zip(METRICS, result.metrics[0, j], strict=True)) for j in range(2))
    assert math.isnan(lift["response_time"])
    assert math.isnan(lift["settling_time"])
    assert all(math.isnan(rotation[name]) for name in ("response_time", "settling_time", "overshoot", "U_tv"))
    assert lift["iae"] > 0


def test_held_control_changes_at_samples_only(shaken: Program, values_of: Values) -> None:
    result = run(shaken, values_of(shaken), LoopSettings(200, 1e-4, hold=10, output_every=1), sampled=True)
    assert result.trajectory is not None
    u = result.trajectory[0, :200, 15]
    assert (u.reshape(20, 10) == u[::10, None]).all()
    assert len(np.unique(u)) == 20


def test_sampling_at_every_step_tends_to_continuous_control(shaken: Program, values_of: Values) -> None:
    values = values_of(shaken)
    smooth = run(shaken, values, LoopSettings(5000, 1e-4)).final_state[0, :2]
    errors = [
        np.abs(run(shaken, values, LoopSettings(n, 0.5 / n), sampled=True).final_state[0, :2] - smooth).max()
        for n in (5000, 10000)
    ]
    assert errors[0] < 1e-3
    assert errors[1] < 0.6 * errors[0]


def test_rows_are_every_so_often_and_the_last(shaken: Program, values_of: Values) -> None:
    for steps, every in ((100, 7), (100, 10), (5, 10)):
        settings = LoopSettings(steps, 1e-3, output_every=every)
        result = run(shaken, values_of(shaken), settings)
        assert result.trajectory is not None
        assert result.rows is not None
        expected = sorted({*range(0, steps + 1, every), steps})
        assert settings.rows == result.rows[0] == len(expected)
        assert (result.trajectory[0, :, 0] == np.array(expected) * 1e-3).all()


def test_divergence_is_flagged_with_quantity_and_time(shaken: Program, values_of: Values) -> None:
    """Without fast control the run ends; it keeps the last finite state, and a row for it."""
    values = values_of(shaken, {"control.K_f.0": 0.0, "control.K_f.1": 0.0})
    settings = LoopSettings(40000, 1e-4, output_every=1000)
    result = run(shaken, values, settings)
    assert result.status[0] == 2
    assert 0.2 < result.end_time[0] < 0.6
    state = result.final_state[0]
    assert (np.abs(state) <= settings.bound).all()
    assert result.quantity[0] in (6, 7)
    assert result.trajectory is not None
    assert result.rows is not None
    last = result.trajectory[0, result.rows[0] - 1]
    assert last[0] == result.end_time[0]
    assert last[1:9].tobytes() == state.tobytes()
    assert np.isnan(result.trajectory[0, result.rows[0] :]).all()
    unbounded = run(shaken, values, replace(settings, bound=math.inf))
    assert unbounded.status[0] == 1
    assert np.isfinite(unbounded.final_state).all()


def test_not_a_number_is_divergence(shaken: Program, values_of: Values) -> None:
    broken = with_plant(shaken, lambda x: ca.sqrt(-1.0 - x**2))
    result = run(broken, values_of(shaken), LoopSettings(10, 1e-3))
    assert result.status[0] == 1
    assert result.end_time[0] == 0.0
    assert np.isfinite(result.final_state).all()


OVERFLOWS = {
    "sigma_lift": {"reference.lift.terms.0.phase": 1.0, "reference.lift.terms.0.amplitude": 1e160},
    "sigma_rotation": {"reference.rotation.offset": -1e120},
    "e_rotation": {"reference.rotation.offset": 1.7e308, "initial.q.1": -1.7e308},
    "U_lift": {"control.K_f.0": 1e305, "initial.dq.0": -1e5},
    "U_rotation": {"mechanism.L3": 1e300},
    "a_law_lift": {"control.k1": 1e308},
    "a_law_rotation": {"control.k2": 1e308, "initial.q.0": 0.0, "initial.dq.0": math.pi},  # lift is on its reference
}
LIMITS = {"control.U_max.0": 500.0, "control.U_max.1": 100.0}


@pytest.mark.parametrize("limits", [{}, LIMITS], ids=["no limit", "U_max"])
@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize(
    "options",
    [PLAIN, KernelOptions(width=4, groups=2), KernelOptions(width=2, groups=1, packs=2), KernelOptions("casadi")],
    ids=["scalar", "W4G2", "W2P2", "casadi"],
)
def test_control_that_overflows_ends_the_run_and_is_named(
    options: KernelOptions, sampled: bool, limits: dict[str, float], shaken: Program, values_of: Values
) -> None:
    """Whether or not U_max turns the command into a number; the runs beside it have the bits that they have alone."""
    sound = values_of(shaken, limits)
    values = np.stack([item for case in OVERFLOWS.values() for item in (values_of(shaken, {**limits, **case}), sound)])
    settings = LoopSettings(40, 1e-4, hold=3, output_every=7, bound=math.inf)
    kernel = compiled(shaken, sampled=sampled, options=options)
    result = kernel.run(values, settings)
    names = [quantity_name(shaken.system, quantity) for quantity in result.quantity[::2]]
    assert names == list(OVERFLOWS)
    assert {STATUS[status] for status in result.status[::2]} == {"diverged"}
    assert (result.end_time[::2] == 0.0).all()
    assert np.isfinite(result.final_state).all()
    assert np.isnan(result.metrics[::2]).all(), "there was not one sample to judge"
    assert result.trajectory is not None and result.rows is not None
    assert (result.rows[::2] == 1).all()
    for row, name in zip(result.trajectory[::2, 0], names, strict=True):
        if name.startswith("a_law"):  # in no column, and a_max has made a number of it
            assert np.isfinite(row).all()
            continue
        place = shaken.system.n * ["q1", "dq1", "q2", "dq2", "q1d", "e", "sigma", "U"].index(name.partition("_")[0])
        assert not np.isfinite(row[1 + place : 1 + place + 2]).all(), "the row shows what it was"
    alone = kernel.run(sound[None], settings)
    assert STATUS[alone.status[0]] == "ok"
    for run_beside in range(1, len(values), 2):
        assert result.final_state[run_beside].tobytes() == alone.final_state[0].tobytes()
        assert result.metrics[run_beside].tobytes() == alone.metrics[0].tobytes()


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("options", [PLAIN, WIDE, CASADI], ids=["scalar", "lanes", "casadi"])
def test_control_that_overflows_later_ends_the_run_there(
    options: KernelOptions, sampled: bool, values_of: Values
) -> None:
    """The reference jumps to 1e120, whose cube is none; up to there the run is that of a shorter one."""
    tabled = program(Structure(reference=SignalShape("table", (1, 0))))
    pieces = np.zeros((4, 1, 4))
    pieces[2:, 0, 0] = 1e120
    tables = (SignalTable(0.0, 0.01, False, pieces),)
    values = values_of(tabled, LIMITS)
    settings = LoopSettings(400, 1e-4, hold=8, output_every=1)
    result = run(tabled, values, settings, sampled=sampled, tables=tables, options=options)
    assert STATUS[result.status[0]] == "diverged"
    assert quantity_name(tabled.system, int(result.quantity[0])) == "sigma_lift"
    assert result.end_time[0] == 0.02
    before = run(tabled, values, LoopSettings(199, 1e-4, hold=8), sampled=sampled, tables=tables, options=options)
    assert result.trajectory is not None and result.rows is not None
    assert result.rows[0] == 201
    assert result.trajectory[0, 199, 1:9].tobytes() == before.final_state[0].tobytes()
    assert np.isfinite(result.trajectory[0, :200]).all()
    assert np.isinf(result.trajectory[0, 200, 13])
    for name in ("iae", "U_max"):
        k = METRICS.index(name)
        assert result.metrics[0, 0, k] == before.metrics[0, 0, k], "nothing beyond the last sound sample counts"


@pytest.mark.parametrize("sampled", [False, True])
def test_control_that_overflows_at_the_end_is_told_too(sampled: bool, values_of: Values) -> None:
    tabled = program(Structure(reference=SignalShape("table", (1, 0))))
    pieces = np.zeros((2, 1, 4))
    pieces[1, 0, 0] = -1e130
    result = run(
        tabled,
        values_of(tabled, LIMITS),
        LoopSettings(100, 1e-4, hold=50),
        sampled=sampled,
        tables=(SignalTable(0.0, 0.01, False, pieces),),
    )
    assert STATUS[result.status[0]] == "diverged"
    assert result.end_time[0] == 0.01
    assert np.isnan(result.metrics[0, :, METRICS.index("settling_time")]).all()


def parabola(rate: float, knots: int, dt: float, **options: object) -> SignalTable:
    """y = rate t^2 / 2 on the shake, exactly, as cubic pieces."""
    t = np.arange(knots) * dt
    pieces = np.stack([0.5 * rate * t**2, rate * t, np.full(knots, 0.5 * rate), np.zeros(knots)], axis=1)
    return SignalTable(0.0, dt, bool(options.get("periodic", False)), pieces[:, None, :])


@pytest.mark.parametrize("options", [PLAIN, WIDE], ids=["scalar", "lanes"])
def test_table_signals(options: KernelOptions, values_of: Values) -> None:
    """A table that holds a parabola shakes as the parabola does, wraps when periodic, holds its last interval's end."""
    tabled = program(Structure(base_motion=SignalShape("table", (1, 0, 0))))
    settings = LoopSettings(150, 1e-3, output_every=1)
    result = run(tabled, values_of(tabled), settings, tables=(parabola(2.0, 10, 0.02),), options=options)
    assert result.trajectory is not None
    t = result.trajectory[0, :, 0]
    np.testing.assert_allclose(result.trajectory[0, :, 17], t**2, rtol=0, atol=1e-15)
    wrapped = run(tabled, values_of(tabled), settings, tables=(parabola(2.0, 5, 0.02, periodic=True),), options=options)
    assert wrapped.trajectory is not None
    t = t - 0.1 * np.floor(t / 0.1)
    np.testing.assert_allclose(wrapped.trajectory[0, :, 17], t**2, rtol=0, atol=1e-15)
    short = run(tabled, values_of(tabled), settings, tables=(parabola(2.0, 5, 0.02),), options=options)
    assert short.trajectory is not None
    np.testing.assert_allclose(short.trajectory[0, 100:, 17], 0.01, rtol=0, atol=1e-15)


def test_threads_share_nothing(shaken: Program, values_of: Values) -> None:
    kernel = compiled(shaken, options=KernelOptions())
    table = np.tile(values_of(shaken), (24, 1))
    table[:, 1] *= np.linspace(0.9, 1.1, 24)
    settings = LoopSettings(2000, 1e-4)
    expected = kernel.run(table, settings)
    results: dict[int, Runs] = {}
    threads = [threading.Thread(target=lambda i=i: results.update({i: kernel.run(table, settings)})) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(r.final_state.tobytes() == expected.final_state.tobytes() for r in results.values())
    assert len(results) == 4


ENVIRONMENT = """
#include <fenv.h>
#ifdef __SSE2__
#include <xmmintrin.h>
#endif
/* Rounds upward and flushes denormal numbers to zero, as a library of -ffast-math may have the process do. */
void disturb(void) {
  fesetround(FE_UPWARD);
#ifdef __SSE2__
  _mm_setcsr(_mm_getcsr() | 0x8040);
#endif
}
int disturbed(void) { return fegetround() == FE_UPWARD; }
void restore(void) { fesetenv(FE_DFL_ENV); }
"""


def test_rounding_and_flushing_of_the_process_do_not_matter(shaken: Program, values_of: Values) -> None:
    library = toolchain.load(
        toolchain.build_library({"environment.c": ENVIRONMENT}, main="environment.c", flags=("-std=c99", "-lm"))
    )
    kernel = compiled(shaken)
    values = np.stack([values_of(shaken), values_of(shaken, {"initial.dq.0": 5e-324})])
    settings = LoopSettings(20, 1e-3)
    expected = kernel.run(values, settings)
    library.disturb()
    try:
        result = kernel.run(values, settings)
        assert library.disturbed(), "it is the caller's, and stays"
    finally:
        library.restore()
    assert result.final_state.tobytes() == expected.final_state.tobytes()
    assert result.metrics.tobytes() == expected.metrics.tobytes()


@pytest.mark.parametrize("packs", [1, 3])
def test_runs_can_be_watched_and_stopped(packs: int, shaken: Program, values_of: Values) -> None:
    kernel = compiled(shaken, options=replace(PLAIN, packs=packs))
    assert kernel.width == packs
    runs = np.tile(values_of(shaken), (2 * packs, 1))
    watch = Watch()
    watch.stop.value = 1
    result = kernel.run(runs, LoopSettings(100_000, 1e-5, output_every=1), watch=watch)
    assert set(result.status) == {3}
    assert result.trajectory is not None and result.rows is not None
    for end, rows, trajectory in zip(result.end_time, result.rows, result.trajectory, strict=True):
        assert 0.0 < end < 0.1
        assert trajectory[rows - 1, 0] == end, "the last row is where the run was stopped"
    short = kernel.run(runs, LoopSettings(round(result.end_time[0] / 1e-5), 1e-5))
    assert result.end_time.tobytes() == short.end_time.tobytes()
    assert result.final_state.tobytes() == short.final_state.tobytes(), "the state is that of the time"
    watch = Watch()
    kernel.run(runs, LoopSettings(10_000, 1e-5), watch=watch)
    assert watch.progress.value == 2 * packs * 10_000


def test_wrong_shapes_are_refused(shaken: Program, values_of: Values) -> None:
    kernel = compiled(shaken)
    with pytest.raises(ValueError, match=r"expected \(runs, \d+\)"):
        kernel.run(np.zeros((2, 3)), LoopSettings(1, 1e-3))
    with pytest.raises(ValueError, match="the system has 0"):
        kernel.run(values_of(shaken)[None, :], LoopSettings(1, 1e-3), [parabola(1.0, 3, 0.1)])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"steps": -1}, "steps is -1, expected a whole number from 0"),
        ({"steps": MOST_STEPS + 1}, f"steps is {MOST_STEPS + 1}, expected a whole number from 0 to {MOST_STEPS}"),
        ({"steps": 10**4000}, "steps is an integer of 13288 bits"),
        ({"steps": 4.0}, "steps is 4.0, expected a whole number"),
        ({"steps": True}, "steps is True"),
        ({"hold": 0}, "hold is 0, expected a whole number from 1"),
        ({"hold": 2**64}, f"hold is {2**64}"),
        ({"hold": np.uint64(2**63)}, "hold is "),
        ({"output_every": 2**63}, f"output_every is {2**63}"),
        ({"output_every": -1}, "output_every is -1"),
        ({"step": 0.0}, "step is 0.0, expected a positive number"),
        ({"step": math.nan}, "step is nan"),
        ({"step": "1 ms"}, "step is '1 ms'"),
        ({"step": 10**400}, "step is an integer"),
        ({"bound": math.nan}, "bound is nan, expected a positive number or inf"),
        ({"response_band": math.inf}, "response_band is inf"),
        ({"settling_band": None}, "settling_band is None"),
        ({"start_time": math.inf}, "start_time is inf"),
        ({"steps": 2**40, "step": 1e300}, "start_time \\+ steps \\* step, is inf"),
    ],
)
def test_numbers_that_the_loop_cannot_count_with_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(LoopSettings(10, 1e-3), **changes)


def test_integers_of_numpy_are_taken_as_they_are(shaken: Program, values_of: Values) -> None:
    settings = LoopSettings(np.uint16(300), np.float32(0.0625), hold=np.int8(3), output_every=np.uint64(100))
    assert settings == LoopSettings(300, 0.0625, hold=3, output_every=100)
    assert run(shaken, values_of(shaken), replace(settings, step=1e-5)).rows == 4


@pytest.mark.parametrize(
    ("t0", "dt", "shape"),
    [(0.0, 0.0, (3, 1, 4)), (math.nan, 0.1, (3, 1, 4)), (0.0, math.inf, (3, 1, 4)), (0.0, 0.1, (0, 1, 4))],
)
def test_tables_without_an_interval_to_look_up_are_refused(t0: float, dt: float, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="of a table"):
        SignalTable(t0, dt, False, np.zeros(shape))


def test_c_structures_take_no_number_that_they_would_change() -> None:
    """What ctypes cuts off without a word."""
    job = {name: None if kind is ctypes.c_void_p else 0 for name, kind in Job._fields_}
    Job(**job)
    for name, value in (("steps", 2**64), ("last", 2**63), ("output_every", -(2**64) + 5), ("capacity", 2**80)):
        with pytest.raises(ValueError, match=f"{name} is .*, which C would take for"):
            Job(**{**job, name: value})
    with pytest.raises(TypeError, match="has no stepps"):
        Job(**job, stepps=3)


def test_results_beyond_the_memory_are_refused_before_it_is_asked_for(
    shaken: Program, values_of: Values, monkeypatch: pytest.MonkeyPatch
) -> None:
    kernel = compiled(shaken)
    values = values_of(shaken)[None, :]
    with pytest.raises(ValueError, match=r"output_every is 1: 1 x 4398046511105 trajectory rows .* need 1.13e\+06 GB"):
        kernel.run(values, LoopSettings(2**42, 1e-12, output_every=1))
    monkeypatch.setattr(kernel_module, "memory", lambda: 8 * 32 * 100)
    assert kernel.run(values, LoopSettings(99, 1e-6, output_every=1)).rows == 100
    with pytest.raises(ValueError, match="101 trajectory rows"):
        kernel.run(values, LoopSettings(100, 1e-6, output_every=1))


def test_a_metric_that_only_one_side_knows_is_an_error(shaken: Program, monkeypatch: pytest.MonkeyPatch) -> None:
    """The C has one more than Python, which would have it write past the end of its array."""
    here = len(shaken.system.metrics)
    jerk = replace(metrics.METRICS[-1], name="jerk")
    monkeypatch.setattr(kernel_metrics, "METRICS", (*metrics.METRICS, jerk))
    with pytest.raises(LayoutError, match=f"metrics: {here + shaken.system.n}, expected {here}"):
        compiled(shaken)


def test_a_job_of_another_size_is_an_error(shaken: Program, monkeypatch: pytest.MonkeyPatch) -> None:
    sources = dict(kernel_source.runtime_sources())
    sources["simulate.h"] = sources["simulate.h"].replace(
        "  int64_t capacity;", "  int64_t another;\n  int64_t capacity;"
    )
    size = ctypes.sizeof(Job)
    monkeypatch.setattr(kernel_source, "runtime_sources", lambda: sources)
    with pytest.raises(LayoutError, match=f"bytes of a job: {size + 8}, expected {size}"):
        compiled(shaken)


def test_every_member_of_a_job_is_where_python_writes_it() -> None:
    names = [member.name for member in JOB]
    offsets = ", ".join(f"offsetof(sl_job, {name})" for name in names)
    source = f'#include <stddef.h>\n#include "simulate.h"\nconst int64_t offsets[] = {{{offsets}}};\n'
    files = {**kernel_source.runtime_sources(), "offsets.c": source}
    library = toolchain.load(toolchain.build_library(files, main="offsets.c"))
    found = (ctypes.c_int64 * len(names)).in_dll(library, "offsets")
    assert list(found) == [getattr(Job, name).offset for name in names]
