"""Loops drawn at random: controllers, observers, sensors, motors, arms and drives, and numbers for them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from hypothesis import strategies as st

from springline.codegen.program import program
from springline.model.control import CONTROLLERS, LAWS, Control, Controller, SurfaceExponents
from springline.model.drive import FRICTION
from springline.model.hardware import ACTUATORS, SENSORS
from springline.model.integrators import INTEGRATORS
from springline.model.mechanisms import MECHANISMS
from springline.model.parameters import POSITIVE, REAL, Parameter, Slot
from springline.model.quantities import SIGMA, U_F, U_S, Quantity
from springline.model.structure import SignalShape, Structure
from springline.model.system import System

OWN = "drawn"
"""Stands for a controller that is drawn itself."""

# What an own controller's formulas are made of: every operation that there is C for, bounded and defined everywhere.
_UNARY = {
    "sin": ca.sin,
    "tanh": ca.tanh,
    "atan": ca.atan,
    "soft": lambda x: x / ca.sqrt(1 + x**2),
    "bell": lambda x: ca.exp(-(x**2)),
    "log": lambda x: ca.log1p(ca.fabs(x)),
    "arc": lambda x: ca.asin(ca.tanh(x)) - ca.acos(ca.sin(x)),
    "root": lambda x: ca.sign(x) * (ca.fabs(x) + 1e-9) ** (1 / 3),
    "power": lambda x: (1 + ca.fabs(x)) ** -0.7,
    "steps": lambda x: ca.floor(4 * ca.tanh(x)) - ca.ceil(ca.cos(x)),
    "dead": lambda x: ca.if_else(ca.fabs(x) > 0.1, x, 0.3 * x**3),
    "grown": lambda x: ca.expm1(ca.tanh(x)) + ca.sinh(ca.sin(x)) * ca.cosh(ca.tanh(x)),
}
_BINARY = {
    "sum": lambda x, y: x + 2 * y,
    "product": lambda x, y: ca.tanh(x) * y,
    "greater": ca.fmax,
    "less": ca.fmin,
    "angle": lambda x, y: ca.atan2(x, 1 + y**2),
    "length": ca.hypot,
    "signed": ca.copysign,
    "chosen": lambda x, y: ca.if_else(x < y, x, -y),
    "both": lambda x, y: ca.if_else(ca.logic_or(ca.logic_and(x > 0, y > 0), ca.logic_not(x != y)), x - y, y),
}
_ATOMS = ("e", "de", "q1", "dq1", "z0", "z1", "z2", "q", "ddq", "q2", "dq2", "gain")

Formula = Any
"""The name of an atom, or a tuple: the name of an operation, and its operands."""

formulas: st.SearchStrategy[Formula] = st.recursive(
    st.sampled_from(_ATOMS),
    lambda inner: (
        st.tuples(st.sampled_from(sorted(_UNARY)), inner) | st.tuples(st.sampled_from(sorted(_BINARY)), inner, inner)
    ),
    max_leaves=5,
)


def _value(formula: Formula, atoms: dict[str, ca.SX]) -> ca.SX:
    if isinstance(formula, str):
        return atoms.get(formula, atoms["e"])
    name, *operands = formula
    return {**_UNARY, **_BINARY}[name](*(_value(operand, atoms) for operand in operands))


@dataclass(frozen=True)
class Recipe:
    """An own controller: a formula for its command, for the rate of each of its states and for their update.

    scalar     of each state, whether there is one for all joints
    unwinding  whether rates are told what U_max let through;  updated  whether samples have an update of their own
    """

    command: Formula
    rates: tuple[Formula, ...]
    scalar: tuple[bool, ...]
    unwinding: bool
    updated: bool
    sliding: bool
    shown: bool

    @property
    def name(self) -> str:
        """Kernels and programs are known by the structure, so by the name."""
        return f"drawn_{hashlib.sha256(repr(self).encode()).hexdigest()[:16]}"


@st.composite
def recipes(draw: st.DrawFn) -> Recipe:
    count = draw(st.integers(0, 3))
    return Recipe(
        command=draw(formulas),
        rates=tuple(draw(formulas) for _ in range(count)),
        scalar=tuple(draw(st.booleans()) for _ in range(count)),
        unwinding=draw(st.booleans()),
        updated=draw(st.booleans()),
        sliding=draw(st.booleans()),
        shown=draw(st.booleans()),
    )


def controller_of(recipe: Recipe) -> Controller:
    """A PD law on the rigid model, with a drawn formula besides."""
    declared = tuple(
        Quantity(f"z{k}", f"z_{k}", "1", f"state {k}", per="scalar" if scalar else "joint", initial=0.1 * k)
        for k, scalar in enumerate(recipe.scalar)
    )

    class Drawn(Controller):
        name = recipe.name
        title = "drawn controller"
        parameters = (
            Parameter("kp", "1/s^2", 400.0, "gain on the error", POSITIVE, per_joint=True),
            Parameter("kd", "1/s", 40.0, "gain on its rate", POSITIVE),
            Parameter("gain", "1", 0.7, "of the formulas", REAL, per_joint=True),
        )
        states = declared
        diagnostics = ((SIGMA,) if recipe.sliding else ()) + ((U_S, U_F) if recipe.shown else ())

        def _atoms(self, r: Any, y: Any, z: Any, p: Any) -> dict[str, ca.SX]:
            n = y.q1.numel()
            found = {"e": r.q - y.q1, "de": r.dq - y.dq1, "gain": p.gain, "q": r.q, "ddq": r.ddq / 10}
            found |= {name: y[name] for name in y}
            for k, scalar in enumerate(recipe.scalar):
                state = z[f"z{k}"]
                found[f"z{k}"] = ca.repmat(state, n, 1) if scalar else state
            return found

        def _rates(self, atoms: dict[str, ca.SX], more: ca.SX) -> dict[str, ca.SX]:
            def of(k: int) -> ca.SX:
                state, found = atoms[f"z{k}"], _value(recipe.rates[k], atoms)
                rate = 3 * (found + more - state) / ca.sqrt(1 + (found - state) ** 2)
                return ca.sum1(rate) / rate.numel() if recipe.scalar[k] else rate

            return {f"z{k}": of(k) for k in range(len(recipe.rates))}

        def control(self, r: Any, y: Any, z: Any, model: Any, p: Any) -> Control:
            atoms, arm = self._atoms(r, y, z, p), model(y.q1, y.dq1)
            sigma = atoms["de"] + 5 * atoms["e"]
            push = _value(recipe.command, atoms)
            slow = arm.H @ (r.ddq + p.kd * atoms["de"] + p.kp * atoms["e"] + 5 * ca.tanh(push)) + arm.c + arm.G
            fast = p.K_f * (y.dq1 - y.dq2) if "dq2" in y else ca.SX.zeros(slow.numel())
            u = slow + fast
            shown = {U_S.name: slow, U_F.name: fast} if recipe.shown else {}
            shown |= {SIGMA.name: sigma} if recipe.sliding else {}
            if recipe.unwinding:
                return Control(u, atoms["e"], lambda limited: self._rates(atoms, 1e-2 * (limited - u)), shown)
            return Control(u, atoms["e"], self._rates(atoms, ca.SX(0)), shown)

        def update(self, r: Any, y: Any, z: Any, model: Any, p: Any, h: ca.SX) -> Any:
            if not recipe.updated:
                return None
            atoms = self._atoms(r, y, z, p)

            def ahead(limited: ca.SX) -> dict[str, ca.SX]:
                rates = self._rates(atoms, 1e-3 * ca.tanh(limited))
                return {name: z[name] + ca.tanh(h * rate) for name, rate in rates.items()}

            return ahead

    return Drawn()


@dataclass(frozen=True)
class Loop:
    """A structure, its controller if that is drawn, and the seed of its numbers."""

    structure: Structure
    recipe: Recipe | None
    seed: int

    @property
    def brought(self) -> dict[str, Controller]:
        """The controller to be known by its name."""
        return {self.recipe.name: controller_of(self.recipe)} if self.recipe else {}


SEEDS = st.integers(0, 2**32 - 1)
_SHAPES = st.lists(st.integers(0, 2), min_size=6, max_size=6).map(tuple)


@st.composite
def loops(draw: st.DrawFn, controllers: tuple[str, ...] = (OWN, *CONTROLLERS), hardware: bool = True) -> Loop:
    """hardware: with sensors, actuators and a delay, which go with sampled control."""
    controller = draw(st.sampled_from(controllers))
    recipe = draw(recipes()) if controller == OWN else None
    mechanism, size = draw(
        st.sampled_from([("planar_arm", 2), ("transfer_manipulator", 0), ("planar_arm", 1), ("planar_arm", 3)])
    )
    n = len(MECHANISMS[mechanism].of_size(size).joints)
    drive = draw(st.sampled_from(["elastic", "rigid"]))
    frictions = [item.name for item in FRICTION if drive == "elastic" or item.name.startswith("link")]
    effects = [effect.name for effect in (*SENSORS, *ACTUATORS)]
    chosen = draw(st.sets(st.sampled_from(effects))) if hardware else set()
    differenced = draw(st.booleans()) if hardware else False
    if differenced:
        chosen.discard("velocity_noise")  # there are no measured rates
    rubbing = draw(st.sets(st.sampled_from(frictions)))
    structure = Structure(
        mechanism=mechanism,
        size=size,
        drive=drive,
        controller=recipe.name if recipe else controller,
        law=draw(st.sampled_from(list(LAWS))),
        log_form=draw(st.sampled_from(["power", "base"])),
        exponents=draw(st.sampled_from([SurfaceExponents(), SurfaceExponents(5, 3, 3, 5)])),
        observer=draw(st.sampled_from(["disturbance", "none", "extended_state"])),
        feedforward=draw(st.sampled_from(["none", "base"])),
        base_motion=SignalShape("sine", draw(_SHAPES)),
        mount=draw(st.booleans()),
        mount_rpy=draw(st.booleans()),
        reference=SignalShape("sine", tuple(draw(st.integers(0, 2)) for _ in range(n))),
        disturbance=draw(st.sampled_from([SignalShape(), SignalShape("sine", (1,) * n)])),
        initial_motor=draw(st.sampled_from(["unloaded", "equilibrium"])),
        start=draw(st.sampled_from(["given", "reference"])),
        integrator=draw(st.sampled_from(sorted(INTEGRATORS))),
        friction=tuple(name for name in frictions if name in rubbing),
        effects=tuple(name for name in effects if name in chosen),
        delay=draw(st.sampled_from([0, 1, 7, 13])) if hardware else 0,
        differenced=differenced,
        **_driven(draw(st.sampled_from(["command", "spring"])), drive),
    )
    return Loop(structure, recipe, draw(SEEDS))


def _driven(source: str, drive: str) -> dict[str, Any]:
    return {"observer_input": source if drive == "elastic" else "command"}


_USUAL = {
    "base_motion": {"amplitude": 0.05, "omega": 4.0, "phase": 3.0, "mount": 1.0, "mount_rpy": 0.3},
    "reference": {"amplitude": 0.2, "omega": 3.0, "phase": 3.0, "offset": 0.5},
    "disturbance": {"amplitude": 2.0, "omega": 20.0, "phase": 3.0, "offset": 2.0},
    "initial": {"q": 0.5, "dq": 0.5, "q_motor": 0.5},
}
"""Table -> entry -> standard deviation of numbers of either sign."""
_CHOSEN = {
    "position_noise": (0.0, 1e-4),
    "velocity_noise": (0.0, 1e-3),
    "position_resolution": (0.0, 1e-4),
    "velocity_cutoff": (np.inf, 2000.0),
    "lag": (0.0, 3e-4, 2e-3),
    "rate_limit": (np.inf, 2e4, 3e3),
    "U_max": (np.inf, 300.0, 20.0),
    "a_max": (np.inf, 200.0, 20.0),
    "nu": (2.0, 4.0),
}


def _number(slot: Slot, rng: np.random.Generator) -> float:
    """One that an arm lives with; zero and infinity, which say that there is nothing, are among them."""
    table, *path = slot.key.split(".")
    name = next(part for part in reversed(path) if not part.isdecimal())
    if table in _USUAL:
        return float(rng.normal() * _USUAL[table][name])
    if name in _CHOSEN:
        return float(rng.choice(_CHOSEN[name]))
    return slot.default * rng.uniform(0.8, 1.25) if slot.default else 0.2 * rng.uniform()


def numbers_of(structure: Structure, seed: int) -> np.ndarray:
    """All numbers of a structure; those of the plant are off what the controller believes, now and then."""
    rng, found = np.random.default_rng(seed), {}
    for slot in program(structure).system.slots:
        table, _, name = slot.key.partition(".")
        value = _number(slot, rng)
        if table == "plant":
            (nominal,) = (found[key] for key in (f"mechanism.{name}", f"drive.{name}") if key in found)
            value = nominal * float(rng.choice([1.0, rng.uniform(0.9, 1.1)]))
        found[slot.key] = value if slot.bounds.holds(value) else slot.default
    return np.array(list(found.values()))


def columns(structure: Structure) -> list[str]:
    """Names of a trajectory's columns."""
    return [entry.name for entry in System(structure).trajectory]
