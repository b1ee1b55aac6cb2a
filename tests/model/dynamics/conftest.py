"""Equations of motion of any mechanism as functions of numbers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest

from springline.model.dynamics import EquationsOfMotion, equations_of_motion
from springline.model.mechanisms import Link, Mechanism
from springline.model.parameters import Joint, Parameter, ParameterVector


@dataclass
class Imu:
    """Stands for a base: what an inertial measurement unit reads is free."""

    omega: ca.SX
    alpha: ca.SX
    force: ca.SX
    constants = ca.SX(0, 1)

    def rest_force(self, g):
        return ca.vertcat(0, g, 0)

    def specific_force(self, g):
        return self.force

    def excess_force(self, g):
        return self.force - ca.vertcat(0, g, 0)


@dataclass
class Derived:
    """A mechanism's equations in one form: `terms(q, dq, omega, alpha, force, **numbers)` by name."""

    mechanism: Mechanism
    equations: EquationsOfMotion
    function: ca.Function
    names: list[str]
    defaults: np.ndarray

    def terms(self, q, dq, omega=(0, 0, 0), alpha=(0, 0, 0), force=(0, 9.81, 0), numbers: Mapping[str, float] = {}):
        p = [numbers.get(name, default) for name, default in zip(self.names, self.defaults, strict=True)]
        return {
            name: np.array(value).squeeze(axis=1) if value.shape[1] == 1 and name != "mass" else np.array(value)
            for name, value in self.function(q=q, dq=dq, w=omega, a=alpha, f=force, p=p).items()
        }


@pytest.fixture(scope="session")
def derive() -> Callable[..., Derived]:
    def made(mechanism: Mechanism, form=None) -> Derived:
        vector, n = ParameterVector(), len(mechanism.joints)
        p = vector.table("mechanism", mechanism.parameters, mechanism.joints)
        q, dq, imu = ca.SX.sym("q", n), ca.SX.sym("dq", n), Imu(*(ca.SX.sym(name, 3) for name in "waf"))
        found = equations_of_motion(mechanism, q, dq, imu, p, form)
        outputs = [found.mass, found.coriolis, found.gravity, found.disturbance, found.bias]
        function = ca.Function(
            "terms", [q, dq, imu.omega, imu.alpha, imu.force, vector.sx], outputs,
            ["q", "dq", "w", "a", "f", "p"], ["mass", "coriolis", "gravity", "disturbance", "bias"],
        )  # fmt: skip
        keys = [slot.key.removeprefix("mechanism.") for slot in vector.slots]
        return Derived(mechanism, found, function, keys, np.array([slot.default for slot in vector.slots]))

    return made


def chain(kinds, frames="generic", parents=None) -> Mechanism:
    """A chain (or tree) of links with parameters for every entry.

    kinds   "r" or "p" a joint;  frames: "generic", or "quarter" for quarter turns, exact zeros and diagonal inertias
    """
    n, declared = len(kinds), []
    for k in range(n):
        for name in ("x", "y", "z"):
            declared += [Parameter(f"{what}{k}{name}", "1", 0.0, "an entry") for what in ("o", "t", "u", "c")]
        declared += [Parameter(f"m{k}", "kg", 1.0, "mass")]
        declared += [Parameter(f"I{k}{a}{b}", "kg m^2", 0.0, "an entry") for a in "xyz" for b in "xyz" if a <= b]

    class Chain(Mechanism):
        joints = tuple(Joint(f"j{k}", "rad" if kind == "r" else "m", "N") for k, kind in enumerate(kinds))
        parameters = (*declared, Parameter("g", "m/s^2", 9.81, "gravity"))
        motor_inertia = (Parameter("rotor", "kg", 0.1, "motor", per_joint=True),)
        stiffness = (Parameter("spring", "N", 1e4, "spring", per_joint=True),)

        def links(self, p):
            return [self._link(k, p) for k in range(n)]

        def _link(self, k, p):
            def three(what):
                return tuple(p[f"{what}{k}{name}"] for name in "xyz")

            inertia = [[p[f"I{k}{min(a, b)}{max(a, b)}"] for b in "xyz"] for a in "xyz"]
            parent = k - 1 if parents is None else parents[k]
            joint = "revolute" if kinds[k] == "r" else "prismatic"
            if frames == "generic":
                return Link(f"l{k}", joint, parent, three("o"), three("t"), three("u"), p[f"m{k}"], three("c"), inertia)
            turn, place = ((np.pi / 2) * (-1) ** k, 0, 0), (0, p[f"o{k}y"], 0)
            diagonal = [[inertia[a][b] if a == b else 0 for b in range(3)] for a in range(3)]
            return Link(
                f"l{k}", joint, parent, place, turn, (0, 0, 1), p[f"m{k}"], (0, p[f"c{k}y"], p[f"c{k}z"]), diagonal
            )

    return Chain()


def numbers_for(n, rng) -> dict[str, float]:
    """Physical numbers for the parameters of `chain`: inertias of eight points of mass."""
    found = {}
    for k in range(n):
        for name in "xyz":
            found |= {
                f"o{k}{name}": rng.normal(0, 0.4),
                f"t{k}{name}": rng.uniform(-3, 3),
                f"c{k}{name}": rng.normal(0, 0.2),
            }
            found[f"u{k}{name}"] = rng.normal()
        found[f"m{k}"] = rng.uniform(0.5, 5.0)
        inertia = inertia_of(rng)
        found |= {f"I{k}{a}{b}": inertia["xyz".index(a), "xyz".index(b)] for a in "xyz" for b in "xyz" if a <= b}
    return found


def inertia_of(rng) -> np.ndarray:
    points = rng.normal(0, 0.3, (8, 3))
    points -= points.mean(axis=0)
    second = points.T @ points
    return np.trace(second) * np.eye(3) - second


@pytest.fixture(scope="session")
def make_chain():
    return chain


@pytest.fixture(scope="session")
def make_numbers():
    return numbers_for
