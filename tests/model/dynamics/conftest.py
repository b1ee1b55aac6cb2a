"""Equations of motion of any mechanism as functions of numbers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from chains import chain, numbers_for

from springline.model.dynamics import EquationsOfMotion, equations_of_motion
from springline.model.mechanisms import Mechanism
from springline.model.parameters import ParameterVector


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


@pytest.fixture(scope="session")
def make_chain():
    return chain


@pytest.fixture(scope="session")
def make_numbers():
    return numbers_for
