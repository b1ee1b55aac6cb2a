"""What the tests of the model share: a system called with NumPy, and the mechanics derived a second way."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest
import sympy as sp

from springline.model.structure import Structure
from springline.model.system import System

Array = np.ndarray


class Model:
    """A System whose Functions take NumPy arrays; a second axis runs over samples."""

    def __init__(self, structure: Structure | None = None) -> None:
        self.system = System(structure)
        self.keys = [slot.key for slot in self.system.slots]
        self.defaults = np.array([slot.default for slot in self.system.slots])

    def p(self, values: Mapping[str, object] | None = None, both: Mapping[str, object] | None = None) -> Array:
        """The parameter vector with some values replaced; `both`: of the plant and of its nominal model.

        A value may be an array over samples, then so is p (parameters x samples).
        """
        given = dict(values or {})
        for name, value in (both or {}).items():
            nominal = "mechanism" if f"mechanism.{name}" in self.keys else "drive"
            given |= {f"plant.{name}": value, f"{nominal}.{name}": value}
        shape = np.broadcast_shapes(*(np.shape(value) for value in given.values()))
        p = np.array(np.broadcast_to(self.defaults.reshape(-1, *(1 for _ in shape)), (len(self.keys), *shape)))
        for key, value in given.items():
            p[self.keys.index(key)] = value
        return p

    def __call__(self, name: str, *arguments: object, p: Array | None = None) -> Array:
        """The first output of a Function; a matrix is flattened column by column where there are samples."""
        return self.outputs(name, *arguments, p=p)[0]

    def outputs(self, name: str, *arguments: object, p: Array | None = None) -> list[Array]:
        function = self.system.function(name)
        values = [np.asarray(a, dtype=float) for a in (*arguments, self.defaults if p is None else p)]
        samples = {a.shape[1] for a in values if a.ndim == 2}
        if not samples:
            out = function.call(values)
            return [np.array(o).squeeze(axis=1) if o.shape[1] == 1 else np.array(o) for o in out]
        (count,) = samples
        wide = [a if a.ndim == 2 else np.repeat(a.reshape(-1, 1), count, axis=1) for a in values]
        out = function.map(count).call(wide)
        return [
            np.array(o).reshape(function.size1_out(i), count, function.size2_out(i)).transpose(0, 2, 1).squeeze(axis=1)
            if function.size2_out(i) == 1
            else np.array(o).reshape(function.size1_out(i), count, -1).transpose(0, 2, 1)
            for i, o in enumerate(out)
        ]


@pytest.fixture(scope="session")
def model() -> Model:
    """The default system."""
    return Model()


@pytest.fixture(scope="session")
def make_model() -> Callable[..., Model]:
    """Model(structure) for other structures."""
    return Model


@pytest.fixture(scope="session")
def rk4() -> Callable[[Callable[[float, Array], Array], Array, float, int], Array]:
    """rk4(f, x, h, steps): x after so many classical Runge-Kutta steps of dx/dt = f(t, x) from t = 0."""

    def integrate(f: Callable[[float, Array], Array], x: Array, h: float, steps: int) -> Array:
        for k in range(steps):
            t = k * h
            k1 = f(t, x)
            k2 = f(t + h / 2, x + h / 2 * k1)
            k3 = f(t + h / 2, x + h / 2 * k2)
            k4 = f(t + h, x + h * k3)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return x

    return integrate


class Inertial:
    """The arm on a base that moves in several coordinates at once, derived by SymPy in the inertial frame.

    Positions are written in inertial coordinates and differentiated with respect to time; no moving frame, no
    equivalence of gravity and acceleration. Each attribute is a NumPy function of
    (q, dq, ddq, b, db, ddb, parameters) with parameters in the order of `names`.

    left_side   Euler-Lagrange: d/dt dL/d(dq) - dL/dq, 2 x samples, base moving
    energy      kinetic plus potential energy, inertial
    power       d energy / dt along the motion
    base_power  Newton-Euler: rate of work done on the arm by the motion of the base frame
    """

    names: tuple[str, ...] = ("m2", "m3", "J", "L1", "L3", "g")
    base = 3

    def __init__(self) -> None:
        coordinates, rates, accelerations = (sp.symbols(f"c0:{2 + self.base}_{order}") for order in range(3))
        y, theta = coordinates[:2]
        parameters = sp.symbols(" ".join(self.names))
        m2, m3, J, L1, L3, g = parameters[:6]

        def ddt(expression: sp.Matrix) -> sp.Matrix:
            """The total derivative with respect to time."""
            chain = [*zip(coordinates, rates, strict=True), *zip(rates, accelerations, strict=True)]
            return sum((expression.diff(c) * dc for c, dc in chain), 0 * expression)

        up = sp.Matrix([0, 1, 0])
        origin, rotation = self.frame(coordinates[2:])
        foot, standing = self.stand(parameters[6:])
        arm = [sp.Matrix([L1, y, 0]), sp.Matrix([L1 + L3 * sp.cos(theta), y + L3 * sp.sin(theta), 0])]
        stood = [foot + standing * r for r in arm]
        positions = [origin + rotation * r for r in stood]
        velocities = [ddt(r) for r in positions]
        spin = rotation.T * ddt(rotation)
        omega = sp.Matrix([spin[2, 1], spin[0, 2], spin[1, 0]])
        omega_z = (standing.T * omega)[2]
        turning = rates[1] + omega_z

        kinetic, potential = J * turning**2 / 2, sp.Integer(0)
        carried = ddt(turning) * J * omega_z  # work rate of the base frame's motion
        for m, r, v, s in zip((m2, m3), positions, velocities, stood, strict=True):
            kinetic += m * v.dot(v) / 2
            potential += m * g * r[1]
            carried += m * (ddt(v) + g * up).dot(ddt(origin) + ddt(rotation) * s)
        lagrangian = kinetic - potential
        left = [ddt(lagrangian.diff(rates[i])) - lagrangian.diff(coordinates[i]) for i in range(2)]

        arguments = [s[part] for part in (slice(0, 2), slice(2, None)) for s in (coordinates, rates, accelerations)]

        def compiled(*expressions: sp.Expr) -> Callable[..., Array]:
            function = sp.lambdify([*arguments, parameters], expressions, cse=True)
            return lambda *values: np.array(function(*values))

        self.left_side = compiled(*left)
        self.energy = compiled(kinetic + potential)
        self.power = compiled(ddt(kinetic + potential))
        self.base_power = compiled(carried)

    def frame(self, b: Sequence[sp.Symbol]) -> tuple[sp.Matrix, sp.Matrix]:
        """The base's origin, and the rotation of its axes: shake along Y; pitch, then roll."""
        shake, pitch, roll = b
        return sp.Matrix([0, shake, 0]), sp.rot_ccw_axis3(pitch) * sp.rot_ccw_axis1(roll)

    def stand(self, mount: Sequence[sp.Symbol]) -> tuple[sp.Matrix, sp.Matrix]:
        """The arm's foot, and the rotation of its axes, in base axes."""
        return sp.zeros(3, 1), sp.eye(3)


class InertialOfSix(Inertial):
    """The same with six coordinates of the base, in the model's order, and an arm that stands somewhere on it."""

    names = (*Inertial.names, "x", "y", "z", "roll", "pitch", "yaw")
    base = 6

    def frame(self, b: Sequence[sp.Symbol]) -> tuple[sp.Matrix, sp.Matrix]:
        """Yaw about Y, then pitch, then roll."""
        heave, pitch, roll, surge, sway, yaw = b
        return sp.Matrix([surge, heave, sway]), self.turned(roll, pitch, yaw)

    def stand(self, mount: Sequence[sp.Symbol]) -> tuple[sp.Matrix, sp.Matrix]:
        """Anywhere, and turned in the same order."""
        return sp.Matrix(mount[:3]), self.turned(*mount[3:])

    @staticmethod
    def turned(roll: sp.Symbol, pitch: sp.Symbol, yaw: sp.Symbol) -> sp.Matrix:
        return sp.rot_ccw_axis2(yaw) * sp.rot_ccw_axis3(pitch) * sp.rot_ccw_axis1(roll)


@pytest.fixture(scope="session")
def inertial() -> Inertial:
    return Inertial()


@pytest.fixture(scope="session")
def inertial_of_six() -> InertialOfSix:
    return InertialOfSix()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(474)
