"""The mass matrix, the singular perturbation (2)-(11) from the full plant, and the closed slow loop (16)."""

import numpy as np
import pytest

COUNT = 1000
BASE_SIZE = (1.0, 3.0, 9.0)


def random_motion(rng, count=COUNT):
    """q1, dq1, base motion, slow motor force; columns are samples."""
    u = rng.uniform
    q = np.stack([u(-3, 3, count), u(-np.pi, np.pi, count)])
    base = [u(-size, size, (3, count)) for size in BASE_SIZE]
    return q, u(-5, 5, (2, count)), base, u(-1000, 1000, (2, count))


def random_arm(model, rng, count=COUNT):
    """Random parameters of the plant alone, over two decades each."""
    names = ("m2", "m3", "J", "L3", "m_l", "I")
    return model.p({f"plant.{name}": 10 ** rng.uniform(-1, 1, count) for name in names})


def solve(matrix, rhs):
    """Solve for each sample; matrix n x n x samples, rhs n x samples."""
    return np.linalg.solve(matrix.transpose(2, 0, 1), rhs.T[..., None])[..., 0].T


def diagonal(values, count):
    return np.repeat(np.diag(values)[..., None], count, axis=2)


def test_mass_matrix_is_symmetric_positive_definite(model, rng):
    q, *_ = random_motion(rng)
    p = random_arm(model, rng)
    for name in ("mass_matrix", "slow_mass"):
        mass = model(name, q, p=p)
        np.testing.assert_array_equal(mass, mass.transpose(1, 0, 2))
        assert np.all(np.linalg.eigvalsh(mass.transpose(2, 0, 1))[:, 0] > 0)


def test_mass_matrix_bounds_of_the_paper(model):
    """a1 |rho|^2 <= rho' M1 rho <= b1 |rho|^2 over all positions, with Table 3's numbers."""
    theta = np.linspace(-np.pi, np.pi, 721)
    eigenvalues = np.linalg.eigvalsh(model("mass_matrix", np.stack([0 * theta, theta])).transpose(2, 0, 1))
    # the extremes lie at theta3 = 0, where M1 = [[50, 29.6], [29.6, 29.2053]]
    mean, half, off = (50 + 29.2053333) / 2, (50 - 29.2053333) / 2, 29.6
    spread = np.hypot(half, off)
    assert eigenvalues.min() == pytest.approx(mean - spread, rel=1e-6)
    assert eigenvalues.max() == pytest.approx(mean + spread, rel=1e-6)


def test_slow_mass(model, rng):
    """H = M1 + M2."""
    q, *_ = random_motion(rng)
    difference = model("slow_mass", q) - model("mass_matrix", q)
    np.testing.assert_allclose(difference, diagonal([2.0, 0.01], COUNT), atol=1e-13)


def test_slow_dynamics(model, rng):
    """(4): H ddq1 + C dq1 + G = U_s + S."""
    q, dq, base, u = random_motion(rng)
    p = random_arm(model, rng)
    ddq = model("slow_dynamics", *base, q, dq, u, p=p)
    bias = model("coriolis", q, dq, p=p) + model("gravity", q, p=p) - model("base_disturbance", *base, q, dq, p=p)
    expected = solve(model("slow_mass", q, p=p), u - bias)
    np.testing.assert_allclose(ddq, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_quasi_steady_force(model, rng):
    """(8) as a linear solve, and (3): the same force is U_s - M2 ddq1 of the slow subsystem."""
    q, dq, base, u = random_motion(rng)
    force = model("quasi_steady_force", *base, q, dq, u)
    inertia = np.array([2.0, 0.01])
    mass = model("mass_matrix", q)
    load = model("base_disturbance", *base, q, dq) - model("coriolis", q, dq) - model("gravity", q)
    eye = diagonal(np.ones(2), COUNT)
    inverse = np.stack([solve(mass, eye[:, i]) for i in range(2)], axis=1)
    by_eight = solve(diagonal(1 / inertia, COUNT) + inverse, u / inertia[:, None] - solve(mass, load))
    by_three = u - inertia[:, None] * model("slow_dynamics", *base, q, dq, u)
    scale = np.abs(u) + np.abs(load)
    assert np.max(np.abs(force - by_eight) / scale) < 1e-12
    assert np.max(np.abs(force - by_three) / scale) < 1e-12


def test_plant_at_the_quasi_steady_force_is_slow(model, rng):
    """Springs stretched by zbar: link and motor both accelerate as the slow subsystem says, for any stiffness."""
    q, dq, base, u = random_motion(rng)
    stiffness = np.array([[2e3], [2e1]])
    p = model.p({"plant.k_s2": 2e3, "plant.k_s3": 2e1})
    force = model("quasi_steady_force", *base, q, dq, u, p=p)
    x = np.concatenate([q, dq, q + force / stiffness, dq])
    dx = model("plant", *base, x, u, p=p)
    ddq = model("slow_dynamics", *base, q, dq, u, p=p)
    # (u - z) / I: the rotation's motor is 0.01 kg m^2, so rounding of z is worth a hundred times as much
    tolerance = 1e-12 * (1 + np.abs(u) + np.abs(force)) / np.array([[2.0], [0.01]])
    assert np.all(np.abs(dx[2:4] - ddq) < tolerance)
    assert np.all(np.abs(dx[6:8] - ddq) < tolerance)


def test_plant_is_equation_one(model, rng):
    """M1 ddq1 + C dq1 + G + K (q1 - q2) = S and M2 ddq2 + K (q2 - q1) = U, residuals of what `plant` returns."""
    q, dq, base, u = random_motion(rng)
    q2 = q + rng.uniform(-1e-3, 1e-3, q.shape)
    dq2 = rng.uniform(-5, 5, q.shape)
    dx = model("plant", *base, np.concatenate([q, dq, q2, dq2]), u)
    np.testing.assert_array_equal(dx[:2], dq)
    np.testing.assert_array_equal(dx[4:6], dq2)
    z = np.array([[2e6], [2e4]]) * (q2 - q)
    inertia = np.array([[2.0], [0.01]])
    mass = model("mass_matrix", q)
    terms = [
        np.einsum("ijk,jk->ik", mass, dx[2:4]),
        model("coriolis", q, dq),
        model("gravity", q),
        -z,
        -model("base_disturbance", *base, q, dq),
    ]
    # M1 ddq1 is small where its two products are large: they set the size of rounding
    scale = np.einsum("ijk,jk->ik", np.abs(mass), np.abs(dx[2:4])) + np.abs(z)
    assert np.max(np.abs(sum(terms)) / scale) < 1e-13
    assert np.max(np.abs(inertia * dx[6:8] + z - u) / (np.abs(z) + np.abs(u))) < 1e-13


def run_plant(model, rk4, p, base, u, start, h, steps):
    plant = model.system.function("plant")
    return rk4(lambda t, x: plant(*base(t), x, u(t), p).full()[:, 0], start, h, steps)


def test_stiff_springs_approach_the_slow_subsystem(model, rk4):
    """The full plant's link motion tends to the slow subsystem's in proportion to 1/K."""
    start = np.array([0.8, 0.5, 0.3, -1.0])
    omega = np.array([1.5, 2.0, 1.0])

    def u(t):
        return np.array([500 + 50 * np.sin(3 * t), 270 + 30 * np.cos(2 * t)])

    def base(t):
        return 0.2 * np.sin(omega * t), 0.2 * omega * np.cos(omega * t), -0.2 * omega**2 * np.sin(omega * t)

    slow = model.system.function("slow_dynamics")
    h, steps = 5e-4, 600
    limit = rk4(
        lambda t, x: np.array([*x[2:], *slow(*base(t), x[:2], x[2:], u(t), model.defaults).full()[:, 0]]),
        start, h, steps,
    )  # fmt: skip
    distance = []
    for factor in (1, 4, 16):
        stiffness = factor * np.array([4e3, 4e1])
        p = model.p({"plant.k_s2": stiffness[0], "plant.k_s3": stiffness[1]})
        force = model("quasi_steady_force", *base(0), start[:2], start[2:], u(0), p=p)
        x = np.concatenate([start, start[:2] + force / stiffness, start[2:]])
        distance.append(np.linalg.norm(run_plant(model, rk4, p, base, u, x, h, steps)[:2] - limit[:2]))
    ratio = np.array(distance[:-1]) / np.array(distance[1:])
    assert distance[0] > 1e-5
    np.testing.assert_allclose(ratio, 4.0, rtol=0.25)


@pytest.mark.parametrize("epsilon", [1.0, 0.1, 0.01])
def test_fast_dynamics_is_the_plant_in_fast_time(model, rng, epsilon):
    """(11) from the full plant: eta = z - zbar, d^2/dtau^2 = epsilon^2 K (ddq2 - ddq1), slow variables frozen."""
    q, dq, base, u_s = random_motion(rng)
    eta, u_f = rng.uniform(-100, 100, (2, *q.shape))
    stiffness = np.array([[2e4], [2e2]]) / epsilon**2
    p = model.p({"plant.k_s2": stiffness[0, 0], "plant.k_s3": stiffness[1, 0], "drive.epsilon": epsilon})
    force = model("quasi_steady_force", *base, q, dq, u_s, p=p)
    x = np.concatenate([q, dq, q + (force + eta) / stiffness, dq])
    dx = model("plant", *base, x, u_s + u_f, p=p)
    from_plant = epsilon**2 * stiffness * (dx[6:8] - dx[2:4])
    found = model("fast_dynamics", q, eta, u_f, p=p)
    # the difference of two large accelerations: rounding of K (q2 - q1), which cancels q2 against q1, is amplified
    rounding = np.finfo(float).eps * (np.abs(q) * stiffness + np.abs(force)) / np.array([[2.0], [0.01]])
    assert np.all(np.abs(from_plant - found) < 4 * epsilon**2 * stiffness * rounding + 1e-12 * np.abs(found))


def test_fast_motion_of_a_stiff_plant(model, rk4):
    """One fast time unit of the full plant, started off the quasi-steady force: eta follows (11) up to O(epsilon)."""
    q, dq, eta0, u = np.array([0.8, 0.5]), np.array([0.3, -1.0]), np.array([30.0, 10.0]), np.array([500.0, 270.0])
    k1 = np.array([2e3, 2e1])
    rest = (np.zeros(3),) * 3
    fast = model.system.function("fast_dynamics")
    error = []
    for epsilon in (0.1, 0.05, 0.025):
        stiffness = k1 / epsilon**2
        p = model.p({"plant.k_s2": stiffness[0], "plant.k_s3": stiffness[1], "drive.epsilon": epsilon})
        force = model("quasi_steady_force", *rest, q, dq, u, p=p)
        x = np.concatenate([q, dq, q + (force + eta0) / stiffness, dq])
        tau, steps = 0.2, 200
        end = run_plant(model, rk4, p, lambda t: rest, lambda t: u, x, epsilon * tau / steps, steps)
        force_end = model("quasi_steady_force", *rest, end[:2], end[2:4], u, p=p)
        eta = stiffness * (end[4:6] - end[:2]) - force_end

        frozen = rk4(
            lambda t, y, p=p: np.array([*y[2:], *fast(q, y[:2], np.zeros(2), p).full()[:, 0]]),
            np.concatenate([eta0, np.zeros(2)]), tau / steps, steps,
        )  # fmt: skip
        assert np.linalg.norm(frozen[:2] - eta0) > 10.0
        error.append(np.linalg.norm(eta - frozen[:2]))
    ratio = np.array(error[:-1]) / np.array(error[1:])
    assert np.all(ratio > 1.7), ratio


def nominal_u_e(model, error, rate, law):
    """(25) in NumPy, with Table 3's numbers, delta = 0.05 and a_max = 200; `law` gives d sigma / dt."""
    mu, lam, delta = np.array([[12.0], [5.0]]), 5.0, 0.05
    h = error**2 + delta**2
    sigma = rate + mu * error**3 + lam * error * h ** (-1 / 3)
    slope = 3 * mu * error**2 + lam * h ** (-4 / 3) * (error**2 / 3 + delta**2)
    wished = np.stack([law(row.reshape(1, -1)).reshape(-1) for row in sigma])
    return np.clip(wished, -200, 200) - slope * rate


def test_closed_loop_of_the_slow_subsystem(model, rng):
    """(16): with the nominal plant dd(e) = u_e - H^-1 S, to rounding."""
    q, dq, base, _ = random_motion(rng)
    reference = [q + rng.uniform(-1, 1, q.shape), dq + rng.uniform(-3, 3, q.shape), rng.uniform(-5, 5, q.shape)]
    x = np.concatenate([q, dq, q, dq])
    u_s, error, _ = model.outputs("slow_control", *reference, x)
    np.testing.assert_allclose(error, reference[0] - q)
    dd_error = reference[2] - model("slow_dynamics", *base, q, dq, u_s)
    u_e = nominal_u_e(model, error, reference[1] - dq, lambda s: model("law_variable_power_log", s))
    felt = solve(model("slow_mass", q), model("base_disturbance", *base, q, dq))
    expected = u_e - felt
    scale = np.max(np.abs(u_e), axis=0) + np.max(np.abs(felt), axis=0) + 10
    assert np.max(np.abs(dd_error - expected) / scale) < 1e-12


def test_slow_control_cancels_the_nominal_arm_exactly(model, rng):
    """With the base at rest the loop is dd(e) = u_e whatever the arm, as long as the controller knows it (14)."""
    count = 200
    names = ("m2", "m3", "J", "L3", "m_l", "I")
    p = model.p(both={name: 10 ** rng.uniform(-1, 1, count) for name in names})
    q, dq, _, _ = random_motion(rng, count)
    reference = [q + 0.1, dq - 0.2, rng.uniform(-5, 5, q.shape)]
    rest = [np.zeros((3, count))] * 3
    u_s = model("slow_control", *reference, np.concatenate([q, dq, q, dq]), p=p)
    found = reference[2] - model("slow_dynamics", *rest, q, dq, u_s, p=p)
    u_e = nominal_u_e(model, reference[0] - q, reference[1] - dq, lambda s: model("law_variable_power_log", s))
    np.testing.assert_allclose(found, u_e, rtol=1e-9)


def test_controller_sees_nominal_parameters_only(model, rng):
    """Other plant parameters and the base's motion leave the command alone; other nominal ones do not."""
    q, dq, _, _ = random_motion(rng, 10)
    reference = [q + 0.1, dq - 0.2, q]
    x = np.concatenate([q, dq, q, dq])
    nominal = model("control", *reference, x)
    plant = model.p({key: 3.3 for key in model.keys if key.startswith("plant.")})
    np.testing.assert_array_equal(model("control", *reference, x, p=plant), nominal)
    for name in ("mechanism.m2", "mechanism.m3", "mechanism.J", "mechanism.L3", "mechanism.g", "drive.m_l", "drive.I"):
        assert np.any(model("control", *reference, x, p=model.p({name: 3.3})) != nominal), name


def test_composite_control(model, rng):
    """(13), (33), E4: U = U_s + K_f (dq1 - dq2), limited per motor."""
    q, dq, _, _ = random_motion(rng, 500)
    dq2 = dq + rng.uniform(-5, 5, dq.shape)
    reference = [q + rng.uniform(-1, 1, q.shape), dq, q]
    x = np.concatenate([q, dq, q, dq2])
    command, slow, fast, *_ = model.outputs("control", *reference, x)
    np.testing.assert_allclose(fast, np.array([[200.0], [2.6]]) * (dq - dq2), rtol=1e-14)
    np.testing.assert_array_equal(model("fast_control", dq, dq2), fast)
    np.testing.assert_array_equal(command, slow + fast)
    limits = {"control.U_max.0": 900.0, "control.U_max.1": 150.0}
    limited = model("control", *reference, x, p=model.p(limits))
    np.testing.assert_array_equal(limited, np.clip(command, [[-900], [-150]], [[900], [150]]))
    assert np.any(limited != command)
    assert np.any(limited == command)
