"""The compiled loop: order, accuracy, sampling, signals, metrics, divergence, threads."""

import math
import threading
from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from springline.codegen import toolchain
from springline.codegen.kernel import METRICS, Control, KernelOptions, LoopSettings, Runs, Table, compile_kernel
from springline.codegen.program import Program, program
from springline.model.linear import as_written
from springline.model.system import SignalShape, Structure

Values = Callable[..., NDArray[np.float64]]
PLAIN = KernelOptions(width=1, groups=1, flags=("-O2",))


def with_plant(base: Program, right_hand_side: Callable[[ca.SX], ca.SX]) -> Program:
    """The loop around another plant dx = f(x)."""
    old = base.functions["plant"]
    inputs = old.sx_in()
    names = [old.name_in(i) for i in range(old.n_in())]
    with as_written():
        plant = ca.Function(old.name(), inputs, [ca.densify(right_hand_side(inputs[2]))], names, ["dx"])
    return Program(base.system, {**base.functions, "plant": plant})


def run(
    base: Program,
    values: NDArray[np.float64],
    settings: LoopSettings,
    *,
    sampled: bool = False,
    tables: tuple[Table, ...] = (),
    options: KernelOptions = PLAIN,
) -> Runs:
    return compile_kernel(base, sampled, options).run(np.atleast_2d(values), settings, tables)


@pytest.mark.parametrize("sampled", [False, True])
def test_rk4_has_order_four(sampled: bool, shaken: Program, values_of: Values) -> None:
    """Four undamped oscillators against cos and sin; order by regression over step sizes."""
    omega = np.array([1.0, 2.0, 3.0, 5.0])
    rotating = with_plant(
        shaken, lambda x: ca.vertcat(*(e for i, w in enumerate(omega) for e in (w * x[2 * i + 1], -w * x[2 * i])))
    )
    values = values_of(shaken)
    kernel = compile_kernel(rotating, sampled, PLAIN)
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
    start = system.function("start")(values)
    expected = np.array(cvodes(x0=start)["xf"]).T
    result = run(still, values, LoopSettings(40000, 1e-4, output_every=5000))
    assert result.trajectory is not None
    actual = result.trajectory[0, 1:, 1:9]
    error = np.abs(actual - expected).max(axis=0)
    assert error[[0, 1, 4, 5]].max() < 1e-5
    assert error[[2, 3]].max() < 1e-4
    assert error[[6, 7]].max() < 1e-2


def metrics_by_hand(rows: NDArray[np.float64], joint: int, settings: LoopSettings) -> dict[str, float]:
    """The definitions of metrics.h on a trajectory with every step."""
    t, e, sigma, u, rate = rows[:, 0], rows[:, 11 + joint], rows[:, 13 + joint], rows[:, 15 + joint], rows[:, 3 + joint]
    size, start, late = np.abs(e), abs(e[0]), 4 * np.arange(len(t)) >= 3 * settings.steps
    inside = np.flatnonzero(size <= settings.response_band * start)
    outside = np.flatnonzero(size > settings.settling_band * start)
    last = outside[-1]
    second = u[settings.steps // 2 :]
    half = (settings.steps - settings.steps // 2) * settings.step
    scale = max(second.max() - second.min(), 1e-3 * np.abs(u).max())
    return {
        "response_time": t[inside[0]],
        "settling_time": t[last] if t[last] <= 0.98 * t[-1] else math.nan,
        "overshoot": max(0.0, (-e * np.sign(e[0])).max()),
        "steady_state_error": size[late].max(),
        "iae": np.trapezoid(size, t),
        "U_max": np.abs(u).max(),
        "chatter": np.abs(np.diff(second)).sum() / half / scale,
        "U_tv": np.abs(np.diff(u[last:])).sum(),
        "sigma_tv": np.abs(np.diff(sigma[last:])).sum(),
        "dq1_tv": np.abs(np.diff(rate[last:])).sum(),
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


def parabola(rate: float, knots: int, dt: float, **options: object) -> Table:
    """y = rate t^2 / 2 on the shake, exactly, as cubic pieces."""
    t = np.arange(knots) * dt
    pieces = np.stack([0.5 * rate * t**2, rate * t, np.full(knots, 0.5 * rate), np.zeros(knots)], axis=1)
    return Table(0.0, dt, bool(options.get("periodic", False)), pieces[:, None, :])


@pytest.mark.parametrize("options", [PLAIN, KernelOptions(width=4, groups=2)], ids=["scalar", "lanes"])
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
    kernel = compile_kernel(shaken, False, KernelOptions())
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
    kernel = compile_kernel(shaken, False, PLAIN)
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
    kernel = compile_kernel(shaken, False, replace(PLAIN, packs=packs))
    assert kernel.width == packs
    runs = np.tile(values_of(shaken), (2 * packs, 1))
    control = Control()
    control.stop.value = 1
    result = kernel.run(runs, LoopSettings(100_000, 1e-5, output_every=1), control=control)
    assert set(result.status) == {3}
    assert result.trajectory is not None and result.rows is not None
    for end, rows, trajectory in zip(result.end_time, result.rows, result.trajectory, strict=True):
        assert 0.0 < end < 0.1
        assert trajectory[rows - 1, 0] == end, "the last row is where the run was stopped"
    short = kernel.run(runs, LoopSettings(round(result.end_time[0] / 1e-5), 1e-5))
    assert result.end_time.tobytes() == short.end_time.tobytes()
    assert result.final_state.tobytes() == short.final_state.tobytes(), "the state is that of the time"
    control = Control()
    kernel.run(runs, LoopSettings(10_000, 1e-5), control=control)
    assert control.progress.value == 2 * packs * 10_000


def test_wrong_shapes_are_refused(shaken: Program, values_of: Values) -> None:
    kernel = compile_kernel(shaken, False, PLAIN)
    with pytest.raises(ValueError, match=r"expected \(runs, \d+\)"):
        kernel.run(np.zeros((2, 3)), LoopSettings(1, 1e-3))
    with pytest.raises(ValueError, match="the system has 0"):
        kernel.run(values_of(shaken)[None, :], LoopSettings(1, 1e-3), [parabola(1.0, 3, 0.1)])
