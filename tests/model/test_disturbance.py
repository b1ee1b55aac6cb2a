"""A disturbance force acts on the links, along +q1: its power is what the energy gains, and nothing else changes."""

import numpy as np
import pytest

from springline.model.drive import FRICTION
from springline.model.structure import SignalShape, Structure

REST = (np.zeros(3),) * 3
ALL = tuple(item.name for item in FRICTION)


@pytest.mark.parametrize("kind", ["sine", "table", "input"])
@pytest.mark.parametrize("drive", ["elastic", "rigid"])
def test_its_power_is_what_the_energy_gains(drive, kind, make_model, rng):
    """dE/dt with the force - dE/dt without = F . dq1, at 500 random states with friction and a moving base."""
    friction = ALL if drive == "elastic" else ALL[1:]
    pushed = make_model(Structure(drive=drive, friction=friction, disturbance=SignalShape(kind, (1, 1))))
    free = make_model(Structure(drive=drive, friction=friction))
    x, u = rng.uniform(-1, 1, (8 if drive == "elastic" else 4, 500)), rng.uniform(-500, 500, (2, 500))
    force = rng.uniform(-200, 200, (2, 500))
    base = [rng.uniform(-1, 1, (3, 500)) for _ in range(3)]
    slope = pushed.system.function("energy").jacobian()
    by_state = np.array(
        [slope(x[:, k], pushed.defaults, 0)[0].full()[0] for k in range(500)]  # the energy's, base at rest
    )
    gained = pushed("plant", *base, force, x, u) - free("plant", *base, x, u)
    power = np.sum(by_state[:, : len(gained)] * gained.T, axis=1)
    np.testing.assert_allclose(power, np.sum(force * x[2:4], axis=0), rtol=0, atol=1e-8)
    motors = gained[6:] if drive == "elastic" else gained[:2]
    assert not motors.any(), "it acts on nothing else"


def test_it_is_a_sum_of_sines_about_an_offset_and_absent_without(make_model, model):
    pushed = make_model(Structure(disturbance=SignalShape("sine", (1, 2))))
    assert "disturbance" not in model.system.function("plant").name_in()
    assert pushed.system.w.numel() == model.system.w.numel() + 2
    terms = {"disturbance.lift.offset": 3.0, "disturbance.lift.terms.0.amplitude": 2.0,
             "disturbance.lift.terms.0.omega": 5.0, "disturbance.lift.terms.0.phase": 0.4,
             "disturbance.rotation.terms.1.amplitude": -7.0, "disturbance.rotation.terms.1.omega": 1.0}  # fmt: skip
    w = pushed("signals", 0.3, np.zeros(0), p=pushed.p(terms))
    np.testing.assert_allclose(w[-2:], [3.0 + 2.0 * np.sin(1.9), -7.0 * np.sin(0.3)], rtol=1e-15)


def test_a_start_on_the_reference_carries_it(make_model):
    on = make_model(Structure(start="reference", disturbance=SignalShape("sine", (0, 0))))
    p = on.p({"disturbance.lift.offset": -300.0, "disturbance.rotation.offset": 90.0})
    x = on("start", 0.0, np.zeros(0), p=p)
    dx = on("plant", *REST, [-300.0, 90.0], x, np.zeros(2), p=p)
    np.testing.assert_allclose(dx[2:4], 0, atol=1e-8)
