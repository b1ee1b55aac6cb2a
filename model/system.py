"""The whole system: mechanism, drive, signals and controller put together, as named CasADi Functions.

    State x = [q1, dq1, q2, dq2] (4n x 1; without q2, dq2 where the drive is rigid), controller state z (none for the
    paper's controller). Argument order everywhere: what depends on time, x, z, u, p.

Plant and controller have parameters of their own: "plant.*" is the arm that moves, "mechanism.*" and "drive.*" are what
the controller believes of it. Time enters through w = [q1d, dq1d, ddq1d, b, db, ddb] alone, where a
disturbance acts with its forces behind them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from springline.model import lazy_casadi as ca
from springline.model import perturbation, signals
from springline.model.base import MOUNT, MOUNT_RPY, BaseState
from springline.model.control import (
    A_MAX,
    CONTROLLERS,
    K_F,
    LAWS,
    OBSERVERS,
    SURFACE_PARAMETERS,
    U_MAX,
    VELOCITY_CUTOFF,
    ArmModel,
    Condition,
    Controller,
    ControlSignals,
    Law,
    Observer,
    Observing,
    commanded,
    differenced,
    differencing_states,
    fast_control,
)
from springline.model.declared import column, expect_given, symbols_of
from springline.model.drive import (
    DRIVES,
    EPSILON,
    Drive,
    DriveKind,
    diagonal,
    friction,
    friction_parameters,
    spring_force,
    static_motor_position,
)
from springline.model.dynamics import EquationsOfMotion, equations_of_motion
from springline.model.hardware import EFFECTS, acting, actuated, sensed
from springline.model.integrators import INTEGRATORS, Tableau
from springline.model.mechanisms import MECHANISMS, BodyCheck, Implausible, Mechanism
from springline.model.metrics import METRICS
from springline.model.parameters import REAL, Joint, Parameter, ParameterVector, Slot, Values
from springline.model.quantities import (
    A_LAW,
    A_LIMITED,
    BASE,
    DISTURBANCE,
    DQ1,
    DQ2,
    Q1,
    Q1D,
    REFERENCE,
    SATURATED,
    SIGMA,
    TIP,
    TIP_RATE,
    U_CMD,
    U_S,
    U_WISHED,
    E,
    Entry,
    Quantity,
    T,
    U,
    entries,
)
from springline.model.signal_symbols import SignalSymbols
from springline.model.structure import Structure
from springline.model.symbolic import (
    as_written,
    associated,
    derivation,
    derived_property,
    over_runs,
    solve_spd,
    without,
)
from springline.model.terms import Term, named, noted, section
from springline.model.tip import tip_motion

# Relative to the largest eigenvalue: a mass matrix below this is singular to the precision of what is computed with it.
_SINGULAR = 1e-12
# The Functions of what a controller says, which may be a user's. What else users say is looked at where it comes in.
_OF_CONTROLLER = ("control", "rates", "update")


def control_parameters(mechanism: Mechanism, drive: DriveKind = "elastic") -> tuple[Parameter, ...]:
    """Every numeric parameter of the [control] table, with the mechanism's defaults.

    It is the union over all laws, so that p does not depend on the law; a rigid drive has no fast control.
    """
    seen: dict[str, Parameter] = {}
    for law in LAWS.values():
        seen |= {item.name: item for item in law.parameters}
    fast = (K_F,) if drive == "elastic" else ()
    return tuple(mechanism.fitted(item) for item in (*seen.values(), *SURFACE_PARAMETERS, *fast, A_MAX, U_MAX))


def own_control_tables(structure: Structure) -> dict[str, tuple[Parameter, ...]]:
    """Tables [control.<name>] of a structure: of its controller, its observer, and a law that is a user's own.

    Raises ValueError for two of one name, which would share a table.
    """
    mechanism = MECHANISMS[structure.mechanism].of_size(structure.size)
    controller = CONTROLLERS[structure.controller]
    law = LAWS[structure.law]
    owners: list[Controller | Law | Observer] = [controller, OBSERVERS[structure.observer]]
    owners += [] if LAWS.is_packaged(structure.law) else [law]
    names = [item.name for item in owners]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"two of controller, observer and law are called {name!r}: give one another name")
    return {
        item.name: tuple(mechanism.fitted(parameter, item.name) for parameter in item.parameters)
        for item in owners
        if item.parameters
    }


def _mount_symbols(vector: ParameterVector, structure: Structure) -> tuple[ca.SX | None, ca.SX | None]:
    """Symbols of the mount's place and orientation, 3 x 1 each; None for one that is zero."""

    def symbols(key: str, entries: Iterable[tuple[str, str, str]], meaning: str) -> ca.SX:
        return ca.vertcat(
            *(
                vector.scalar(f"base_motion.{key}.{i}", f"{key}_{name}", unit, 0.0, f"{meaning}: {name}, {where}", REAL)
                for i, (name, unit, where) in enumerate(entries)
            )
        )

    return (
        symbols("mount", MOUNT, "where the arm stands on the base") if structure.mount else None,
        symbols("mount_rpy", MOUNT_RPY, "how the arm's axes are turned on the base") if structure.mount_rpy else None,
    )


class System:
    """Symbols, parameter slots and Functions of one structure.

    n       number of joints
    slots   meaning of each entry of p
    tables  layout of d
    base_motion  motion, rate and acceleration of the base, in the coordinates that are there
    """

    @derivation
    def __init__(self, structure: Structure | None = None) -> None:
        self.structure = structure or Structure()
        self.mechanism: Mechanism = MECHANISMS[self.structure.mechanism].of_size(self.structure.size)
        self.drive: Drive = DRIVES[self.structure.drive]
        law = LAWS[self.structure.law].with_form(self.structure.log_form)
        self.controller: Controller = CONTROLLERS[self.structure.controller].with_law(law, self.structure.exponents)
        self.observer: Observer | None = None
        if self.structure.observer != "none":
            self.observer = OBSERVERS[self.structure.observer].driven_by(self.structure.observer_input)
        self.tableau: Tableau = INTEGRATORS[self.structure.integrator]
        self.joints: tuple[Joint, ...] = self.mechanism.joints
        self.n = n = len(self.joints)

        vector = ParameterVector()
        arm, drive = self.mechanism.parameters, self.drive.parameters(self.mechanism)
        drive = (*drive, *friction_parameters(self.structure.drive, self.structure.friction))
        split = (EPSILON,) if self.structure.drive == "elastic" else ()
        self._nominal = vector.table("mechanism", arm, self.joints)
        self._nominal |= vector.table("drive", (*drive, *split), self.joints)
        self._plant = vector.table("plant", (*arm, *drive), self.joints)
        control_table = control_parameters(self.mechanism, self.structure.drive)
        self._control = vector.table("control", control_table, self.joints)
        tables = own_control_tables(self.structure).items()
        own = {table: vector.table(f"control.{table}", declared, self.joints) for table, declared in tables}
        # What an observer calls its parameters is no concern of the controller's, nor the other way round.
        self._observing = self._control | (own.pop(self.observer.name, Values({})) if self.observer else Values({}))
        for values in own.values():
            self._control |= values
        effects = [EFFECTS[name] for name in self.structure.effects]
        sensors, motors = (
            [item for effect in effects if effect.table == table for item in effect.parameters]
            for table in ("sensor", "actuator")
        )
        sensors += [VELOCITY_CUTOFF] if self.structure.differenced else []
        self._sensor = vector.table("sensor", sensors, self.joints)
        self._actuator = vector.table("actuator", motors, self.joints)
        self.actuators = tuple(effect.name for effect in effects if effect.table == "actuator")

        self.t = ca.SX.sym("t")
        symbols = SignalSymbols(self.t, vector)
        reference = symbols.signal("reference", self.structure.reference, [(j.name, j.unit) for j in self.joints])
        base = symbols.base_motion(self.structure.base_motion, self.joints)
        force = symbols.signal("disturbance", self.structure.disturbance, [(j.name, j.force) for j in self.joints])
        disturbed = self.structure.disturbance.kind != "none"
        self.tables, self.d = symbols.tables, symbols.d
        self._signal_expressions = ca.vertcat(
            *signals.stack(reference), *signals.stack(base), *(item.value for item in force if disturbed)
        )
        mount = _mount_symbols(vector, self.structure)
        self._initial = self._initial_values(vector)
        self.p = vector.sx
        self.slots: tuple[Slot, ...] = tuple(vector.slots)

        self.q1d, self.dq1d, self.ddq1d = (ca.SX.sym(item.name, n) for item in REFERENCE)
        moving = self.structure.base_coordinates
        self.base_motion = tuple(replace(item, coordinates=moving) for item in BASE)
        b, db, ddb = (ca.SX.sym(f"{item.name}b", len(moving)) for item in BASE)
        self.base = BaseState(b, db, ddb, moving, *mount)
        self.disturbance: ca.SX | None = ca.SX.sym("disturbance", n) if disturbed else None
        applied = () if self.disturbance is None else (self.disturbance,)
        self.w = ca.vertcat(self.q1d, self.dq1d, self.ddq1d, self.base.b, self.base.db, self.base.ddb, *applied)
        self._state: dict[Quantity, ca.SX] = {item: ca.SX.sym(item.name, n) for item in self.drive.state}
        self.q1, self.dq1 = self._state[Q1], self._state[DQ1]
        self.x = ca.vertcat(*self._state.values())
        self.u = ca.SX.sym("u", n)
        self.z = ca.SX.sym("z", len(self.memory))
        self.h = ca.SX.sym("h")
        self.noise = ca.SX.sym("noise", self.x.numel() if any(effect.noisy for effect in effects) else 0)
        self.m = ca.SX.sym("m", n * len(self.actuators))
        self.step = ca.SX.sym("step")
        self._sampled = any(effect.sampled for effect in effects)
        self._expect_different_names()
        self._terms: dict[str, tuple[Term, ...]] = {}

    def _expect_different_names(self) -> None:
        """Raise ValueError where two numbers would have one name in C and in tables."""
        symbols = [slot.symbol for slot in self.slots]
        shown = (*self.columns, *REFERENCE, *self.controller.diagnostics, U_WISHED, A_LAW, SATURATED, A_LIMITED)
        entered = [entry.name for entry in entries(dict.fromkeys(shown), self.joints)]
        for names in (symbols, entered, [entry.name for entry in self.metrics]):
            twice = [name for name in names if names.count(name) > 1]
            if twice:
                raise ValueError(f"mechanism {self.mechanism.name}: two numbers would be called {twice[0]!r}")

    def _initial_values(self, vector: ParameterVector) -> dict[str, ca.SX]:
        """Symbols of the [initial] table, n x 1 each."""
        declared = [
            ("q", "{}", "initial joint coordinate"),
            ("dq", "{}/s", "initial joint rate"),
            ("q_motor", "{}", "initial motor coordinate, where it is given"),
        ]
        if self.structure.drive == "rigid":
            declared = declared[:2]
        return {
            name: ca.vertcat(
                *(
                    vector.scalar(
                        f"initial.{name}.{i}",
                        f"initial_{name}_{joint.name}",
                        unit.format(joint.unit),
                        0.0,
                        f"{meaning} ({joint.name})",
                        REAL,
                    )
                    for i, joint in enumerate(self.joints)
                )
            )
            for name, unit, meaning in declared
        }

    # Equations

    def _start(self, real: EquationsOfMotion) -> ca.SX:
        """The state at the beginning, x, of t, d and p."""
        q, dq = self._initial["q"], self._initial["dq"]
        if self.structure.start == "reference":
            q, dq, _ = ca.vertsplit(self._signal_expressions[: 3 * self.n], self.n)
        if self.structure.drive == "rigid":
            return ca.vertcat(q, dq)
        stiffness = diagonal(self.mechanism.stiffness, self._plant)
        if self.structure.start == "reference":
            resistance = friction(self.dq1, self._plant, "link")
            needed = real.mass @ self.ddq1d + real.bias
            needed = needed if resistance is None else needed + resistance
            load = ca.substitute(
                needed if self.disturbance is None else needed - self.disturbance,
                ca.vertcat(self.w, self.q1, self.dq1),
                ca.vertcat(self._signal_expressions, q, dq),
            )
            return ca.vertcat(q, dq, static_motor_position(q, load, stiffness), dq)
        motor = {
            "unloaded": lambda: q,
            "given": lambda: self._initial["q_motor"],
            "equilibrium": lambda: static_motor_position(q, ca.substitute(real.gravity, self.q1, q), stiffness),
        }[self.structure.initial_motor]()
        return ca.vertcat(q, dq, motor, ca.SX.zeros(self.n))

    @property
    def command_parts(self) -> tuple[Quantity, ...]:
        """What the command is the sum of, before its limit."""
        return tuple(self._commanded.parts)

    @property
    def sliding(self) -> tuple[Quantity, ...]:
        """The sliding variable, where the controller has one."""
        return tuple(item for item in self.controller.diagnostics if item == SIGMA)

    @property
    def controller_states(self) -> tuple[Quantity, ...]:
        """What z consists of, by the names of its columns."""
        states = (*self.controller.states, *(self.observer.states if self.observer else ()))
        states += differencing_states(self.drive.state) if self.structure.differenced else ()
        return tuple(replace(state, name=f"z_{state.name}") for state in states)

    @property
    def measured_base(self) -> tuple[Quantity, ...]:
        """The base's motion as the controller is told of it, where it is."""
        if self.structure.feedforward == "none":
            return ()
        return tuple(
            replace(item, name=f"measured_{item.name}", meaning=f"measured {item.meaning}") for item in self.base_motion
        )

    @property
    def memory(self) -> tuple[Entry, ...]:
        """The entries of z."""
        return entries(self.controller_states, self.joints)

    @property
    def z_start(self) -> tuple[float, ...]:
        """What z is at the beginning."""
        return tuple(float(state.initial) for state in self.controller_states for _ in state.entries(self.joints))

    @property
    def forces(self) -> tuple[Quantity, ...]:
        """The disturbance, where there is one."""
        return () if self.disturbance is None else (DISTURBANCE,)

    @derived_property
    def tip(self) -> ca.SX | None:
        """Position and rate of the tip by b, db, q1, dq1 and p, in the order of TIP and TIP_RATE; None without one."""
        tip = self.mechanism.tip(self.q1, self._plant)
        if tip is None:
            return None
        point = column(f"mechanism {self.mechanism.name}", "tip", tip, 3, symbols_of(self.q1, *self._plant.values()))
        return tip_motion(point, self.q1, self.dq1, self.base)

    @property
    def observed(self) -> tuple[Quantity, ...]:
        """What follows from the state and the signals, where the mechanism has it, and is computed for rows alone."""
        return () if self.tip is None else (*TIP, *TIP_RATE)

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """What sensors show in place of the state, where they do at samples alone."""
        return tuple(
            replace(item, name=f"{item.name}_measured", meaning=f"measured {item.meaning}")
            for item in self._seen_through
        )

    @property
    def _seen_through(self) -> list[Quantity]:
        """Quantities of the state in whose place sensors show something at samples."""
        return [
            item for item in self.drive.state if self._sampled and not ca.is_equal(self._shown[item], self._state[item])
        ]

    @derived_property
    def _shown(self) -> dict[Quantity, ca.SX]:
        """What the sensors show of the state."""
        n = self.n
        noise = {item: self.noise[k * n : (k + 1) * n] for k, item in enumerate(self._state) if self.noise.numel()}
        return dict(sensed(self.structure.effects, self._state, self._sensor, noise))

    @property
    def noise_pairs(self) -> tuple[int, ...]:
        """For each block of four entries of `noise`, which pairs a sensor shows: 1 the first, 2 the second, 3 both."""
        shown = ca.vertcat(*(self._shown[item] for item in self._seen_through))
        used = ca.which_depends(shown, self.noise) if self.noise.numel() else []
        return tuple(
            sum(bit for bit, pair in ((1, used[k : k + 2]), (2, used[k + 2 : k + 4])) if any(pair))
            for k in range(0, len(used), 4)
        )

    @property
    def judges(self) -> bool:
        """Whether error and sliding variable of the state are others than those that the controller sees."""
        return bool(self.measured) or self.structure.differenced

    @property
    def columns(self) -> tuple[Quantity, ...]:
        """What a trajectory shows, in the order of the loop's rows."""
        return (
            T,
            *self.drive.state,
            Q1D,
            E,
            *self.sliding,
            U,
            *self.controller_states,
            self.base_motion[0],
            *self.forces,
            *self.observed,
            *self.measured,
            *self.commanded,
        )

    @property
    def commanded(self) -> tuple[Quantity, ...]:
        """The controller's command, where it is not what acts."""
        return (U_CMD,) if self.structure.delay or self.actuators else ()

    @property
    def trajectory(self) -> tuple[Entry, ...]:
        """Columns of a trajectory: those of all its quantities."""
        return entries(self.columns, self.joints)

    @property
    def judged(self) -> tuple[Entry, ...]:
        """What may end a run by leaving its bound, in the order in which the loop counts it: a row without t, a_law."""
        return (*self.trajectory[1:], *entries((A_LAW,), self.joints))

    @property
    def metrics(self) -> tuple[Entry, ...]:
        """Columns of a table of metrics: each for every joint."""
        return entries(METRICS, self.joints)

    @derived_property
    def functions(self) -> dict[str, ca.Function]:
        """All Functions, parameters symbolic. Those of the paper's equations first, then the loop's."""
        real, signals = self.arm, self._sampled_control
        applied = actuated(self.structure.effects, self.u)
        with noted() as terms:
            dx = self.drive.plant(self.x, applied, real, self.mechanism, self._plant, self.disturbance)
        [dx], self._terms["plant"] = self._associated([dx], terms, late=self.u)
        return {
            **self._equations(real, signals, dx),
            **self._loop(real, signals, dx),
        }

    @derived_property
    def arm(self) -> EquationsOfMotion:
        """The arm that moves: its equations of motion, with the plant's parameters."""
        return equations_of_motion(self.mechanism, self.q1, self.dq1, self.base, self._plant)

    @derived_property
    def _body_checks(self) -> tuple[BodyCheck, ...]:
        """Of the controller's arm and of the plant."""
        return tuple(BodyCheck(self.mechanism, p, self.p) for p in (self._nominal, self._plant))

    def start_positions(self, row: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joint coordinates at the start, n x runs: those that are given, or the reference's.

        row  what the signal tables have at time 0;  values: the parameter vector p, slots x runs
        """
        if self.structure.start == "given":
            return values[[k for k, slot in enumerate(self.slots) if slot.key.startswith("initial.q.")]]
        at, rows = np.zeros((1, values.shape[1])), np.tile(row[:, None], values.shape[1])
        (found,) = over_runs(self.function("signals"), at, rows, values)
        return found[:, : self.n, 0].T

    def expect_plausible(self, q: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        """Raise Implausible for what no arm has, in the plant or in what the controller believes of it.

        That is a mass or an inertia that no body has, and a mass matrix of the plant that is not positive definite.
        q  joint coordinates, n x runs;  values: the parameter vector p, slots x runs
        """
        for check in self._body_checks:
            check.expect_plausible(q, values)
        (mass,) = over_runs(self.function("mass_matrix"), q, values)
        finite = np.isfinite(mass).all(axis=(1, 2))
        sizes = np.full((len(mass), self.n), np.nan)
        sizes[finite] = np.linalg.eigvalsh(mass[finite])
        bad = ~(sizes[:, 0] > _SINGULAR * sizes[:, -1])
        if bad.any():
            k = int(bad.argmax())
            at = ", ".join(f"{joint.name} = {value:.6g}" for joint, value in zip(self.joints, q[:, k], strict=True))
            least = f"is not positive definite, its least eigenvalue is {sizes[k, 0]:.3g}"
            remedy = "expected every joint to move a mass or an inertia (or start elsewhere, initial.q)"
            raise Implausible(f"the mass matrix at the start ({at}) {least}: {remedy}", k)

    @derivation
    def unmet(self, values: np.ndarray) -> tuple[str, ...]:
        """Sentences on gains, in the parameter vector p, that are less than what the controller's theory asks for."""
        owners: list[tuple[Controller | Observer, Condition]]
        owners = [(self.controller, item) for item in self.controller.conditions(self._control)]
        if self.observer:
            owners += [(self.observer, item) for item in self.observer.conditions(self._observing)]
        found = []
        for owner, item in owners:
            pair = ca.Function("pair", [self.p], [ca.densify(item.value), ca.densify(item.least)])(values)
            gains, least = (np.array(side).ravel() for side in pair)
            for i, (gain, bound) in enumerate(zip(gains, np.broadcast_to(least, gains.shape), strict=True)):
                if not gain > bound:
                    key = f"control.{owner.name}.{item.gain}" + (f".{i}" if gains.size > 1 else "")
                    text = f"expected > {item.relation} = {bound:.6g}, or {item.effect} does not follow from"
                    found.append(f"{key} is {gain:.6g}: {text} {item.theorem}")
        return tuple(found)

    def terms(self, name: str) -> tuple[Term, ...]:
        """What the model calls the parts of Function `name`; they are the outputs of Function `name`_terms."""
        return self._terms.get(name, ()) if self.functions else ()

    @derived_property
    def _commanded(self) -> ControlSignals:
        """What the controller computes of q1, dq1 and the rest of the state as they are."""
        with noted() as terms:
            signals = self._signals_of_control()
        written = [signals.command, signals.wished, signals.error, signals.sigma, signals.a_law]
        written += [signals.dz, signals.ahead, *signals.parts.values()]
        values, self._terms["control"] = self._associated(written, terms)
        command, wished, error, sigma, a_law, dz, ahead, *others = values
        parts = dict(zip(signals.parts, others, strict=True))
        return ControlSignals(command, wished, parts, error, sigma, a_law, dz, ahead)

    @derived_property
    def _sampled_control(self) -> ControlSignals:
        """What the controller computes of what it is told: of all of the state, or of its positions alone."""
        seen = self._commanded
        if not self.structure.differenced:
            return seen
        with noted() as terms:
            told, after = self.told()
        named_before = self._terms["control"]
        known = [seen.command, seen.wished, seen.error, seen.sigma, seen.a_law, seen.ahead, *seen.parts.values()]
        with as_written():
            values = ca.substitute([*known, *(term.value for term in named_before)], [self.x], [told])
        command, wished, error, sigma, a_law, ahead, *others = values
        parts = dict(zip(seen.parts, others, strict=False))
        late = others[len(parts) :]
        self._terms["control"] = (
            *terms,
            *(replace(term, value=value) for term, value in zip(named_before, late, strict=True)),
        )
        return ControlSignals(command, wished, parts, error, sigma, a_law, ca.SX(0, 1), ca.vertcat(ahead, after))

    def told(self) -> tuple[ca.SX, ca.SX]:
        """The state with rates that are made of differences, and what is remembered for them after the sample."""
        own = self.z[self.z.numel() - self._differencing :]
        rates, after = differenced(self._state, self.joints, own, self._sensor.velocity_cutoff, self.h)
        return ca.vertcat(*(rates.get(item, symbol) for item, symbol in self._state.items())), after

    @property
    def _differencing(self) -> int:
        """How many entries of z, its last, are what differenced rates are made of."""
        declared = differencing_states(self.drive.state) if self.structure.differenced else ()
        return len(entries(declared, self.joints))

    @derived_property
    def stated_control(self) -> ControlSignals:
        """What the controller computes, as it states it: of the state as it is, with nothing put together anew."""
        return self._signals_of_control()

    def _associated(
        self, values: Sequence[ca.SX], terms: Sequence[Term], late: ca.SX | None = None
    ) -> tuple[list[ca.SX], tuple[Term, ...]]:
        """Values and the parts that have names, their sums and products put together in the order of being known."""
        found = associated([*values, *(term.value for term in terms)], [self.p, self.w], late)
        named = zip(terms, found[len(values) :], strict=True)
        return found[: len(values)], tuple(replace(term, value=value) for term, value in named)

    def _signals_of_control(self) -> ControlSignals:
        nominal = equations_of_motion(self.mechanism, self.q1, self.dq1, self.base, self._nominal, self.arm.form)
        model = ArmModel(nominal, self.q1, self.dq1, diagonal(self.mechanism.motor_inertia, self._nominal))
        y = Values({item.name: symbol for item, symbol in self._state.items()})
        own = len(entries(self.controller.states, self.joints))
        z, z_observer, _ = ca.vertsplit(self.z, [0, own, self.z.numel() - self._differencing, self.z.numel()])
        ddq = self.ddq1d
        observing = None
        if self.measured_base:
            with section("what the moving base does", "docs/controllers.md 5"):
                ddq = named("ddq_fed", ddq - named("ddq_base", solve_spd(model(y.q1, y.dq1).H, nominal.disturbance)))
        if self.observer:
            observing = Observing(self.observer, self.joints, y, z_observer, model, self._observing)
            with section("what the observer has found", "docs/controllers.md 4"):
                ddq = named("ddq_d", ddq - named("d", observing.d))
        r = Values({"q": self.q1d, "dq": self.dq1d, "ddq": ddq})
        signals = commanded(self.controller, self.joints, r, y, z, model, self._control, self.h)
        if observing is None:
            return signals
        force = signals.command
        if self.structure.observer_input == "spring":
            force = spring_force(y.q1, y.q2, diagonal(self.mechanism.stiffness, self._nominal))
        if self.measured_base:  # which is no disturbance any more
            force = force + nominal.disturbance
        rates = observing.rates(force)
        ahead = z_observer + self.h * rates
        return replace(signals, dz=ca.vertcat(signals.dz, rates), ahead=ca.vertcat(signals.ahead, ahead))

    def _function(
        self, name: str, inputs: list[ca.SX], outputs: list[ca.SX], names_in: list[str], names_out: list[str]
    ) -> dict[str, ca.Function]:
        with as_written():
            flat = ca.cse([ca.densify(o) for o in outputs])
            if name in _OF_CONTROLLER:
                owner = f"controller {self.controller.name}"
                expect_given(owner, "control", ca.vertcat(*map(ca.vec, flat)), symbols_of(*map(ca.vec, inputs), self.p))
            return {name: ca.Function(name, [*inputs, self.p], flat, [*names_in, "p"], names_out)}

    def _named(self, name: str, inputs: list[ca.SX], terms: list[ca.SX], names_in: list[str]) -> dict[str, ca.Function]:
        """The parts of Function `name` that have names, as one of its own."""
        labels = [f"term{k}" for k in range(len(terms))]
        return self._function(f"{name}_terms", inputs, terms, names_in, labels) if terms else {}

    def _equations(self, real: EquationsOfMotion, seen: ControlSignals, dx: ca.SX) -> dict[str, ca.Function]:
        """The equations of docs/paper.md, as they are offered to others."""
        q1, dq1, x, base, function = self.q1, self.dq1, self.x, self.base, self._function
        m2 = diagonal(self.mechanism.motor_inertia, self._plant)
        u_slow, u_fast, eta, sigma = (
            ca.SX.sym(name, n) for name, n in (("u_s", self.n), ("u_f", self.n), ("eta", self.n), ("sigma", 1))
        )
        ref_in, ref_names = [self.q1d, self.dq1d, self.ddq1d], ["q1d", "dq1d", "ddq1d"]
        base_in, base_names = [base.b, base.db, base.ddb], ["b", "db", "ddb"]
        force_in, force_names = ([], []) if self.disturbance is None else ([self.disturbance], [DISTURBANCE.name])
        plant_in, plant_names = [*base_in, *force_in, x, self.u], [*base_names, *force_names, "x", "u"]
        slow_args, slow_names = [*base_in, q1, dq1, u_slow], [*base_names, "q1", "dq1", "u_s"]
        slow = perturbation.slow_dynamics(u_slow, real.disturbance, real, m2)
        z_in, z_names = ([self.z], ["z"]) if self.memory else ([], [])
        parts, part_names = list(seen.parts.values()), [item.name.lower() for item in seen.parts]
        sigma_out, sigma_names = ([seen.sigma], ["sigma"]) if self.sliding else ([], [])
        result = {
            **function("mass_matrix", [q1], [real.mass], ["q1"], ["M1"]),
            **function("coriolis", [q1, dq1], [real.coriolis], ["q1", "dq1"], ["C_dq1"]),
            **function("gravity", [q1], [real.gravity], ["q1"], ["G"]),
            **function("base_disturbance", [*base_in, q1, dq1], [real.disturbance], [*base_names, "q1", "dq1"], ["S"]),
            **function("plant", plant_in, [dx], plant_names, ["dx"]),
            **function("slow_dynamics", slow_args, [slow], slow_names, ["ddq1"]),
        }
        if self.structure.drive == "elastic":
            stiffness = diagonal(self.mechanism.stiffness, self._plant)
            steady = perturbation.quasi_steady_force(u_slow, real.disturbance, real, m2)
            fast = perturbation.fast_dynamics(eta, u_fast, real.mass, m2, stiffness, self._nominal.epsilon)
            dq2 = self._state[DQ2]
            result |= {
                **function("quasi_steady_force", slow_args, [steady], slow_names, ["z_bar"]),
                **function("fast_dynamics", [q1, eta, u_fast], [fast], ["q1", "eta", "u_f"], ["ddeta"]),
                **function(
                    "fast_control", [dq1, dq2], [fast_control(dq1, dq2, self._control.K_f)], ["dq1", "dq2"], ["u_f"]
                ),
            }
        fed_in, fed_names = (base_in, base_names) if self.measured_base else ([], [])
        period_in, period_names = ([self.h], ["h"]) if self.structure.differenced else ([], [])
        at, at_names = [*ref_in, *fed_in, x, *z_in], [*ref_names, *fed_names, "x", *z_names]
        ins, names = [*at, *period_in], [*at_names, *period_names]
        if U_S in seen.parts:
            slow_outputs = [seen.parts[U_S], seen.error, *sigma_out]
            result |= function("slow_control", ins, slow_outputs, names, ["u_s", "e", *sigma_names])
        result |= function(
            "control",
            ins,
            [seen.command, *parts, seen.error, *sigma_out],
            names,
            ["u", *part_names, "e", *sigma_names],
        )
        result |= self._named("control", ins, [term.value for term in self._terms["control"]], names)
        result |= self._named("plant", plant_in, [term.value for term in self._terms["plant"]], plant_names)
        if self.memory and not self.structure.differenced:
            result |= function("rates", at, [seen.dz], at_names, ["dz"])
        if self.memory:
            result |= function("update", [*at, self.h], [seen.ahead], [*at_names, "h"], ["z_next"])
        if self.judges:
            true = self._commanded
            sigma_true = [true.sigma] if self.sliding else []
            result |= function("judged", at, [true.error, *sigma_true], at_names, ["e", *sigma_names])
        if self.controller.law:
            for law in {**LAWS, self.structure.law: self.controller.law}.values():
                with noted() as terms:
                    rate = law.with_form(self.structure.log_form).rate(sigma, self._control)
                [rate], _ = self._associated([ca.SX(rate)], terms)
                result |= function(f"law_{law.name}", [sigma], [rate], ["sigma"], ["dsigma"])
        if self.tip is not None:
            result |= function("tip", [base.b, base.db, x], [self.tip], ["b", "db", "x"], ["tip"])
        energy = self._arm_energy() + self.drive.energy(x, self.mechanism, self._plant)
        return {
            **result,
            **function("energy", [x], [energy], ["x"], ["energy"]),
            **function("slow_mass", [q1], [perturbation.slow_mass(real.mass, m2)], ["q1"], ["H"]),
        }

    def _loop(self, real: EquationsOfMotion, commanded: ControlSignals, dx: ca.SX) -> dict[str, ca.Function]:
        """What the simulation loop consists of."""
        w, x, function = self.w, self.x, self._function
        z_in, z_names = ([self.z], ["z"]) if self.memory else ([], [])
        ins, names = [w, x, *z_in], ["w", "x", *z_names]
        y = ca.vertcat(*self._shown.values())
        seen = [commanded.command, commanded.error, commanded.sigma, commanded.wished, commanded.a_law]
        later = [commanded.dz, commanded.ahead]
        judged = [self._commanded.error, self._commanded.sigma]  # of the state as it is, whatever the controller sees
        control_terms, plant_terms = ([term.value for term in self._terms[name]] for name in ("control", "plant"))
        if self.measured_base:
            seen, later, control_terms, judged = (
                without(values, self._still) for values in (seen, later, control_terms, judged)
            )
        noise_in, noise_names = ([self.noise], ["noise"]) if self.noise.numel() else ([], [])
        if self.structure.effects:
            with as_written():  # the operations that the controller does to what it is shown
                seen, later, control_terms = (
                    ca.substitute(values, [x], [y]) for values in (seen, later, control_terms)
                )
        seen[1:3] = judged
        sampling, sampling_names = [*ins, *noise_in], [*names, *noise_names]
        updating, updating_names = [*sampling, self.h], [*sampling_names, "h"]
        if self.structure.differenced:
            sampling, sampling_names = updating, updating_names
        measured = [self._shown[item] for item in self._seen_through]
        measured_out, measured_names = ([ca.vertcat(*measured)], ["measured"]) if measured else ([], [])
        dx, *plant_terms = without([dx, *plant_terms], self._still)
        result = {
            **function("measure", [x, *noise_in], [y], ["x", *noise_names], ["y"]),
            **function("signals", [self.t, self.d], [self._signal_expressions], ["t", "d"], ["w"]),
            **function("start", [self.t, self.d], [self._start(real)], ["t", "d"], ["x"]),
            **function(
                "loop_control",
                sampling,
                [*seen, *measured_out],
                sampling_names,
                ["u", "e", "sigma", "wished", "a_law", *measured_names],
            ),
            **function("loop_error", ins, judged, names, ["e", "sigma"]),
            **function("loop_plant", [w, x, self.u], [dx], ["w", "x", "u"], ["dx"]),
            **self._named("loop_control", sampling, control_terms, sampling_names),
            **self._named("loop_plant", [w, x, self.u], plant_terms, ["w", "x", "u"]),
        }
        if self.commanded:
            arrived = ca.SX.sym("arrived", self.n)
            memory = dict(zip(self.actuators, ca.vertsplit(self.m, self.n) if self.actuators else (), strict=True))
            forces, after = acting(self.actuators, arrived, memory, self.step, self.tableau.nodes, self._actuator)
            result |= function(
                "loop_actuate",
                [arrived, self.m, self.step],
                [ca.vertcat(*forces), ca.vertcat(ca.SX(0, 1), *(after[name] for name in self.actuators))],
                ["arrived", "m", "step"],
                ["acting", "m_next"],
            )
        if self.tip is not None:
            at = ca.substitute(self.tip, w, self._signal_expressions)
            result |= function("loop_tip", [self.t, self.d, x], [at], ["t", "d", "x"], ["tip"])
        if self.memory and not self.structure.differenced:
            result |= function("loop_rates", sampling, later[:1], sampling_names, ["dz"])
        if self.memory:
            result |= function("loop_update", updating, later[1:], updating_names, ["z_next"])
        return result

    @property
    def _still(self) -> ca.SX:
        """Those symbols of the base's motion that are zero whatever the numbers are: what does not move."""
        motion = slice(3 * self.n, 3 * self.n + 3 * self.base.b.numel())
        pairs = zip(ca.vertsplit(self.w[motion]), ca.vertsplit(self._signal_expressions[motion]), strict=True)
        return ca.vertcat(ca.SX(0, 1), *(symbol for symbol, value in pairs if value.is_zero()))

    def _arm_energy(self) -> ca.SX:
        """Kinetic and potential energy of the arm with the base at rest, J."""
        rest, up = ca.SX.zeros(3), self.base.rest_force(self._plant.g)
        moving = self.mechanism.kinetic_energy(self.q1, self.dq1, rest, self._plant)
        return moving + self.mechanism.potential_energy(self.q1, up, self._plant)

    def function(self, name: str) -> ca.Function:
        """The Function `name`; KeyError lists the names there are."""
        if name not in self.functions:
            raise KeyError(f"no function {name!r}; there are: {', '.join(self.functions)}")
        return self.functions[name]


@derivation
@lru_cache(maxsize=64)
def system_of(structure: Structure) -> System:
    """The System of a structure; the same object for equal structures, so that its equations are derived once."""
    return System(structure)
