"""Every integrator is what its tableau says: of its order, with its own nodes, the same in both engines."""

import math

import numpy as np
import pytest
from scipy.integrate._ivp import dop853_coefficients, rk
from scipy.linalg import expm

from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, kernel
from springline.model.integrators import INTEGRATORS, Tableau
from springline.model.structure import SignalShape, Structure
from springline.model.system import System

pytestmark = pytest.mark.usefixtures("other_arms")

OMEGA, AMPLITUDE, DURATION = 7.0, 0.3, 1.0
QUICK = ("-O0",)  # optimisation changes no bit: test_engines.py compares its levels
VALUES = {
    "base_motion.heave.0.amplitude": AMPLITUDE,
    "base_motion.heave.0.omega": OMEGA,
    "initial.q.0": 0.4,
    "initial.dq.0": -0.2,
    "control.a_max.0": 5.0,
}


def structure_of(integrator):
    """A mass on a spring on a base that shakes, under the command of the first sample: linear, forced by a sine."""
    sine = SignalShape("sine", (0,))
    return Structure(
        mechanism="slider", reference=sine, base_motion=SignalShape("sine", (1, 0, 0)), integrator=integrator
    )


def simulate(integrator, steps, **options):
    options = KernelOptions(width=1, groups=1, packs=1, flags=QUICK, **options)
    loop = kernel(KernelSpec(structure_of(integrator), True, options=options))
    values = np.array([[VALUES.get(slot.key, slot.default) for slot in System(structure_of(integrator)).slots]])
    settings = LoopSettings(steps, DURATION / steps, hold=steps, output_every=steps)
    runs = loop.run(values, settings)
    return runs.final_state[0], runs.trajectory[0]


def exact(force):
    """The state at the end, from the matrix exponential of the forced system."""
    m, motor, spring, g = 3.0, 1.0, 50.0, 9.81
    # x = [q1, dq1, q2, dq2, sin wt, cos wt, 1]; the base's acceleration is -A w^2 sin wt
    flow = np.zeros((7, 7))
    flow[0, 1] = flow[2, 3] = 1.0
    flow[1, [0, 2]] = -spring / m, spring / m
    flow[1, 4], flow[1, 6] = AMPLITUDE * OMEGA**2, -g
    flow[3, [0, 2]] = spring / motor, -spring / motor
    flow[3, 6] = force / motor
    flow[4, 5], flow[5, 4] = OMEGA, -OMEGA
    start = [0.4, -0.2, 0.4, 0.0, 0.0, 1.0, 1.0]
    return (expm(flow * DURATION) @ start)[:4]


@pytest.mark.parametrize("name", list(INTEGRATORS))
def test_order(name):
    """The error of the final state falls with the power of the step that the order says, by regression."""
    tableau = INTEGRATORS[name]
    steps = {1: (400, 800, 1600), 2: (50, 100, 200), 4: (20, 40, 80), 5: (80, 160, 320), 8: (4, 8, 16)}[tableau.order]
    _, rows = simulate(name, steps[0])
    expected = exact(rows[0, 8])  # t, four states, reference, error, sliding variable, command
    errors = [np.max(np.abs(simulate(name, count)[0] - expected)) for count in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert -slope == pytest.approx(tableau.order, abs=0.25), errors


@pytest.mark.parametrize("name", list(INTEGRATORS))
def test_engines_and_widths_agree_to_the_bit(name):
    reference, _ = simulate(name, 40, engine="casadi")
    np.testing.assert_array_equal(simulate(name, 40)[0], reference)
    loop = kernel(KernelSpec(structure_of(name), options=KernelOptions(width=4, groups=2, flags=QUICK)))
    scalar = kernel(KernelSpec(structure_of(name), options=KernelOptions(engine="casadi", flags=QUICK)))
    values = np.array([[VALUES.get(slot.key, slot.default) for slot in System(structure_of(name)).slots]] * 9)
    values[:, loop.parameters.index("initial.q.0")] = np.linspace(-0.3, 0.4, 9)
    settings = LoopSettings(200, 1e-3, output_every=50)
    wide, one = loop.run(values, settings), scalar.run(values, settings)
    np.testing.assert_array_equal(wide.final_state, one.final_state)
    np.testing.assert_array_equal(wide.trajectory, one.trajectory)


@pytest.mark.parametrize(("name", "a", "b", "c"), [
    ("dopri5", rk.RK45.A, rk.RK45.B, rk.RK45.C),
    ("dop853", dop853_coefficients.A[:12, :12], dop853_coefficients.B, dop853_coefficients.C[:12]),
])  # fmt: skip
def test_numbers_are_those_of_another_library(name, a, b, c):
    tableau = INTEGRATORS[name]
    np.testing.assert_array_equal(np.array(tableau.b, float), b)
    np.testing.assert_array_equal(np.array(tableau.c, float), c)
    for row, other in zip(tableau.a, a, strict=True):
        np.testing.assert_allclose(np.array(row, float), other[: len(row)], rtol=1e-15)


def test_a_tableau_that_does_not_fit_together_is_refused():
    with pytest.raises(ValueError, match="expected 2 rows of 0 to 1 factors"):
        Tableau("x", "x", 1, ((), ()), (0.5, 0.5), (0, 1))
    with pytest.raises(ValueError, match="row sums"):
        Tableau("x", "x", 1, ((), (0.5,)), (0.5, 0.5), (0, 1))
    with pytest.raises(ValueError, match="sum b = 1"):
        Tableau("x", "x", 1, ((), (1,)), (0.5, 0.6), (0, 1))
    with pytest.raises(ValueError, match="within the step"):
        Tableau("x", "x", 1, ((), (2,)), (0.5, 0.5), (0, 2))


def test_eighth_order_at_one_millisecond_beats_rk4_at_a_tenth():
    """The paper's arm, sampled at 1 ms: dop853 with a third of the evaluations is at least as accurate in q1."""
    values = {"reference.lift.terms.0.omega": math.pi, "reference.lift.terms.0.amplitude": 1.0,
              "reference.rotation.offset": 1.0, "reference.rotation.terms.0.amplitude": 1.0,
              "reference.rotation.terms.0.omega": math.pi / 2, "initial.q.0": 0.8, "initial.q.1": 0.5}  # fmt: skip

    def final(integrator, per_sample):
        options = KernelOptions(width=1, groups=1, packs=1, flags=QUICK)
        loop = kernel(KernelSpec(Structure(integrator=integrator), True, options=options))
        p = np.array([[values.get(slot.key, slot.default) for slot in System().slots]])
        return loop.run(p, LoopSettings(600 * per_sample, 1e-3 / per_sample, hold=per_sample)).final_state[0, :2]

    truth = final("dop853", 8)
    eighth, fourth = (np.max(np.abs(final(*case) - truth)) for case in (("dop853", 1), ("rk4", 10)))
    assert eighth <= fourth
    assert fourth < 1e-5
