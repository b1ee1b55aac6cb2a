"""The whole system: mechanism, drive, signals and controller put together, as named CasADi Functions.

    State x = [q1, dq1, q2, dq2] (4n x 1). Argument order everywhere: what depends on time, x, u, p.

Plant and controller have parameters of their own: "plant.*" is the arm that moves, "mechanism.*" and "drive.*" are what
the controller believes of it. Time enters through w = [q1d, dq1d, ddq1d, b, db, ddb] alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import casadi as ca

from springline.model import perturbation, signals
from springline.model.base import COORDINATES, BaseMotion
from springline.model.control import K_F, U_MAX, control, fast_control
from springline.model.drive import EPSILON, plant, static_motor_position
from springline.model.lagrange import Mechanism, equations_of_motion
from springline.model.linear import as_written
from springline.model.mechanisms import MECHANISMS
from springline.model.parameters import REAL, Joint, Parameter, ParameterVector, Slot, Values
from springline.model.signals import CONSTANT_ZERO, Signal
from springline.model.sliding import A_MAX, LAWS, SURFACE_PARAMETERS, LogForm, SurfaceExponents

SignalKind = Literal["none", "sine", "table"]
MotorStart = Literal["unloaded", "equilibrium", "given"]


@dataclass(frozen=True, slots=True)
class SignalShape:
    """The shape of a vector signal: its kind, and per coordinate the number of sine terms or if it has a column.

    sine: terms[i] is the number of terms of coordinate i. table: terms[i] is 1 with a column, 0 (zero) without.
    """

    kind: SignalKind = "none"
    terms: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Structure:
    """Everything about a system that is no number: a new structure is a new kernel, a new number is not."""

    mechanism: str = "transfer_manipulator"
    law: str = "variable_power_log"
    log_form: LogForm = "power"
    exponents: SurfaceExponents = field(default_factory=SurfaceExponents)
    reference: SignalShape = SignalShape("sine", (1, 1))
    base_motion: SignalShape = SignalShape("none", (0, 0, 0))
    initial_motor: MotorStart = "unloaded"


@dataclass(frozen=True, slots=True)
class TableLayout:
    """Where a table stands in the data vector d: d[start] is tau (s from the knot), then four coefficients a channel.

    channels: indices of the signal's coordinates that have a column, in the order of their coefficients.
    """

    signal: Literal["reference", "base_motion"]
    start: int
    channels: tuple[int, ...]


def control_parameters() -> tuple[Parameter, ...]:
    """Every numeric parameter of the [control] table: the union over all laws, so that p does not depend on the law."""
    seen: dict[str, Parameter] = {}
    for law in LAWS.values():
        seen |= {item.name: item for item in law.parameters}
    return (*seen.values(), *SURFACE_PARAMETERS, K_F, A_MAX, U_MAX)


class System:
    """Symbols, parameter slots and Functions of one structure.

    n       number of joints
    slots   meaning of each entry of p
    tables  layout of d
    """

    def __init__(self, structure: Structure | None = None) -> None:
        self.structure = structure or Structure()
        self.mechanism: Mechanism = MECHANISMS[self.structure.mechanism]
        self.joints: tuple[Joint, ...] = self.mechanism.joints
        self.n = n = len(self.joints)

        vector = ParameterVector()
        arm, drive = self.mechanism.parameters, (*self.mechanism.motor_inertia, *self.mechanism.stiffness)
        self._nominal = vector.table("mechanism", arm, self.joints)
        self._nominal |= vector.table("drive", (*drive, EPSILON), self.joints)
        self._plant = vector.table("plant", (*arm, *drive), self.joints)
        self._control = vector.table("control", control_parameters(), self.joints)

        self.t = ca.SX.sym("t")
        self._d: list[ca.SX] = []
        self.tables: tuple[TableLayout, ...] = ()
        reference = self._signals(
            "reference", self.structure.reference, [(j.name, j.unit) for j in self.joints], vector
        )
        base = self._signals("base_motion", self.structure.base_motion, [(c.key, c.unit) for c in COORDINATES], vector)
        self._signal_expressions = ca.vertcat(*signals.stack(reference), *signals.stack(base))
        self._initial = {
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
            for name, unit, meaning in (
                ("q", "{}", "initial joint coordinate"),
                ("dq", "{}/s", "initial joint rate"),
                ("q_motor", "{}", "initial motor coordinate, where it is given"),
            )
        }
        self.d = ca.vertcat(*self._d)
        self.p = vector.sx
        self.slots: tuple[Slot, ...] = tuple(vector.slots)

        self.q1d, self.dq1d, self.ddq1d = (ca.SX.sym(name, n) for name in ("q1d", "dq1d", "ddq1d"))
        self.base = BaseMotion(*(ca.SX.sym(name, len(COORDINATES)) for name in ("b", "db", "ddb")))
        self.w = ca.vertcat(self.q1d, self.dq1d, self.ddq1d, self.base.b, self.base.db, self.base.ddb)
        self.q1, self.dq1, self.q2, self.dq2 = (ca.SX.sym(name, n) for name in ("q1", "dq1", "q2", "dq2"))
        self.x = ca.vertcat(self.q1, self.dq1, self.q2, self.dq2)
        self.u = ca.SX.sym("u", n)

    def _signals(
        self,
        table: Literal["reference", "base_motion"],
        shape: SignalShape,
        coordinates: list[tuple[str, str]],
        vector: ParameterVector,
    ) -> list[Signal]:
        """Expressions of one vector signal; appends its parameters to `vector` or its data to d."""
        if shape.kind == "none":
            return [CONSTANT_ZERO] * len(coordinates)
        if shape.kind == "table":
            tau = ca.SX.sym(f"{table}_tau")
            channels = tuple(i for i, count in enumerate(shape.terms) if count)
            start = sum(symbol.numel() for symbol in self._d)
            self.tables += (TableLayout(table, start, channels),)
            blocks = {i: ca.SX.sym(f"{table}_{coordinates[i][0]}", 4) for i in channels}
            self._d += [tau, *blocks.values()]
            return [signals.cubic(tau, blocks[i]) if i in blocks else CONSTANT_ZERO for i in range(len(coordinates))]
        result = []
        for (key, unit), count in zip(coordinates, shape.terms, strict=True):
            offset = ca.SX(0)
            dotted = f"{table}.{key}"
            if table == "reference":
                offset = vector.scalar(
                    f"{dotted}.offset", f"{table}_{key}_offset", unit, 0.0, f"offset of the {key} reference"
                )
                dotted += ".terms"
            terms = [
                (
                    vector.scalar(
                        f"{dotted}.{k}.amplitude",
                        f"{table}_{key}_{k}_amplitude",
                        unit,
                        0.0,
                        f"amplitude of {key} term {k}",
                    ),
                    vector.scalar(
                        f"{dotted}.{k}.omega",
                        f"{table}_{key}_{k}_omega",
                        "rad/s",
                        0.0,
                        f"angular frequency of {key} term {k}",
                    ),
                    vector.scalar(
                        f"{dotted}.{k}.phase",
                        f"{table}_{key}_{k}_phase",
                        "rad",
                        0.0,
                        f"phase of {key} term {k}",
                    ),
                )
                for k in range(count)
            ]
            result.append(signals.sine_sum(self.t, offset, terms))
        return result

    def _column(self, parameters: tuple[Parameter, ...], values: Values) -> ca.SX:
        return ca.vertcat(*(values[item.name] for item in parameters))

    @cached_property
    def functions(self) -> dict[str, ca.Function]:
        """All Functions, parameters symbolic. Those of the paper's equations first, then the loop's."""
        q1, dq1, x, u, w, p, base = self.q1, self.dq1, self.x, self.u, self.w, self.p, self.base
        real = equations_of_motion(self.mechanism, q1, dq1, base, self._plant)
        nominal = equations_of_motion(self.mechanism, q1, dq1, base, self._nominal)
        m2, stiffness = (self._column(c, self._plant) for c in (self.mechanism.motor_inertia, self.mechanism.stiffness))
        m2_nominal = self._column(self.mechanism.motor_inertia, self._nominal)
        law = LAWS[self.structure.law]
        signals_of_control = control(
            (self.q1d, self.dq1d, self.ddq1d),
            x,
            nominal,
            m2_nominal,
            self._control,
            law,
            self.structure.log_form,
            self.structure.exponents,
        )
        u_slow, u_fast, eta, sigma = (
            ca.SX.sym(name, n) for name, n in (("u_s", self.n), ("u_f", self.n), ("eta", self.n), ("sigma", 1))
        )
        ref_in, ref_names = [self.q1d, self.dq1d, self.ddq1d], ["q1d", "dq1d", "ddq1d"]
        base_in, base_names = [base.b, base.db, base.ddb], ["b", "db", "ddb"]
        dx = plant(x, u, real, m2, stiffness)
        s = signals_of_control

        def function(
            name: str, inputs: list[ca.SX], outputs: list[ca.SX], names_in: list[str], names_out: list[str]
        ) -> ca.Function:
            with as_written():
                flat = ca.cse([ca.densify(o) for o in outputs])
                return ca.Function(name, [*inputs, p], flat, [*names_in, "p"], names_out)

        start_motor = {
            "unloaded": lambda: self._initial["q"],
            "given": lambda: self._initial["q_motor"],
            "equilibrium": lambda: ca.substitute(
                static_motor_position(q1, real.gravity, stiffness), q1, self._initial["q"]
            ),
        }[self.structure.initial_motor]()
        slow_args, slow_names = [*base_in, q1, dq1, u_slow], [*base_names, "q1", "dq1", "u_s"]
        built = [
            function("mass_matrix", [q1], [real.mass], ["q1"], ["M1"]),
            function("coriolis", [q1, dq1], [real.coriolis], ["q1", "dq1"], ["C_dq1"]),
            function("gravity", [q1], [real.gravity], ["q1"], ["G"]),
            function("base_disturbance", [*base_in, q1, dq1], [real.disturbance], [*base_names, "q1", "dq1"], ["S"]),
            function("plant", [*base_in, x, u], [dx], [*base_names, "x", "u"], ["dx"]),
            function(
                "slow_dynamics",
                slow_args,
                [perturbation.slow_dynamics(u_slow, real.disturbance, real, m2)],
                slow_names,
                ["ddq1"],
            ),
            function(
                "quasi_steady_force",
                slow_args,
                [perturbation.quasi_steady_force(u_slow, real.disturbance, real, m2)],
                slow_names,
                ["z_bar"],
            ),
            function(
                "fast_dynamics",
                [q1, eta, u_fast],
                [perturbation.fast_dynamics(eta, u_fast, real.mass, m2, stiffness, self._nominal.epsilon)],
                ["q1", "eta", "u_f"],
                ["ddeta"],
            ),
            function(
                "slow_control",
                [*ref_in, x],
                [s.slow, s.error, s.sigma],
                [*ref_names, "x"],
                ["u_s", "e", "sigma"],
            ),
            function(
                "fast_control",
                [dq1, self.dq2],
                [fast_control(dq1, self.dq2, self._control.K_f)],
                ["dq1", "dq2"],
                ["u_f"],
            ),
            function(
                "control",
                [*ref_in, x],
                [s.command, s.slow, s.fast, s.error, s.sigma],
                [*ref_names, "x"],
                ["u", "u_s", "u_f", "e", "sigma"],
            ),
            *(
                function(
                    f"law_{each.name}",
                    [sigma],
                    [each.rate(sigma, self._control, self.structure.log_form)],
                    ["sigma"],
                    ["dsigma"],
                )
                for each in LAWS.values()
            ),
            function("energy", [x], [self._energy(m2, stiffness)], ["x"], ["energy"]),
            function("slow_mass", [q1], [perturbation.slow_mass(real.mass, m2)], ["q1"], ["H"]),
            function("signals", [self.t, self.d], [self._signal_expressions], ["t", "d"], ["w"]),
            function(
                "start",
                [],
                [ca.vertcat(self._initial["q"], self._initial["dq"], start_motor, ca.SX.zeros(self.n))],
                [],
                ["x"],
            ),
            function(
                "loop_control",
                [w, x],
                [s.command, s.error, s.sigma, s.wished],
                ["w", "x"],
                ["u", "e", "sigma", "wished"],
            ),
            function("loop_error", [w, x], [s.error, s.sigma], ["w", "x"], ["e", "sigma"]),
            function("loop_plant", [w, x, u], [dx], ["w", "x", "u"], ["dx"]),
        ]
        return {item.name(): item for item in built}

    def _energy(self, m2: ca.SX, stiffness: ca.SX) -> ca.SX:
        """Total energy with the base at rest, J: arm, motors, springs."""
        rest, up = ca.SX.zeros(3), ca.vertcat(0, self._plant.g, 0)
        arm = self.mechanism.kinetic_energy(self.q1, self.dq1, rest, self._plant)
        weight = self.mechanism.potential_energy(self.q1, up, self._plant)
        return arm + weight + (ca.dot(m2, self.dq2**2) + ca.dot(stiffness, (self.q2 - self.q1) ** 2)) / 2

    def function(self, name: str) -> ca.Function:
        """The Function `name`; KeyError lists the names there are."""
        if name not in self.functions:
            raise KeyError(f"no function {name!r}; there are: {', '.join(self.functions)}")
        return self.functions[name]
