"""Hardware between plant and controller: what the sensors show of the state, what the motors make of the command.

The loop is described once, in this order:

    signals -> sense -> control -> hold -> delay -> actuate -> plant

`control` is the controller with its limit U_max, and its states z (model/control/) go on where the command does:
in every stage, or once a sample. An effect stands at `sense`, `delay` or `actuate`. Those that a structure names are
part of its Functions, and so of all that is printed from them: the batch kernel, the exported C, FMUs and test vectors.
What no structure names is nowhere printed.

What an effect remembers belongs to the plant, not to the controller: entries behind the plant's own in
springline_state, set by springline_start and moved on by springline_plant_step, once a step. None of it is integrated:
the commands of a delay wait in line, a rate limit remembers its last command, and the force of a lag within a step,
where its command is constant, is an exponential. So the loop asks `acting` once a step for the forces at its nodes.

Random numbers are no state: they follow from a seed and from the numbers of run, sample and channel, which is the place
in the state of what they are added to. Functions take them as an input, noise; codegen/runtime/sl_noise.h makes them,
for both engines and all that is exported.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar, Literal

from springline.model import lazy_casadi as ca
from springline.model.integrators import Number
from springline.model.parameters import LIMIT, NON_NEGATIVE, Parameter, Values
from springline.model.quantities import DQ1, DQ2, Q1, Q2, Quantity

Measured = Mapping[Quantity, "ca.SX"]

POSITIONS, RATES = (Q1, Q2), (DQ1, DQ2)


class Effect:
    """One property of real sensors or motors; a subclass overrides what it changes.

    name        in a Structure
    table       of the scenario, where its numbers stand
    parameters  its numbers; it is there where one of them is not the default, which stands for none
    sampled     whether it is one of samples, which continuous control has none of
    noisy       whether it takes a random number for each quantity of the state and each sample
    """

    name: ClassVar[str]
    table: ClassVar[Literal["sensor", "actuator"]] = "sensor"
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    sampled: ClassVar[bool] = False
    noisy: ClassVar[bool] = False

    @property
    def absent(self) -> float:
        """The number that stands for none of it."""
        (item,) = self.parameters
        assert isinstance(item.default, float)
        return item.default

    def sense(self, y: Measured, p: Values, noise: Measured) -> Measured:
        """What is shown in place of y, n x 1 each; noise: standard normal numbers, empty where no effect is noisy."""
        return y

    def delay(self, u: ca.SX) -> ca.SX:
        """The command that arrives at the motors when u (n x 1) is commanded."""
        return u

    def actuate(self, u: ca.SX) -> ca.SX:
        """The motor force that acts when u (n x 1) arrives."""
        return u


class PositionNoise(Effect):
    """White noise on what encoders show."""

    name, sampled, noisy = "position_noise", True, True
    parameters = (
        Parameter(
            "position_noise", "{q}", 0.0, "standard deviation of the noise on a measured position", NON_NEGATIVE, True
        ),
    )

    def sense(self, y: Measured, p: Values, noise: Measured) -> Measured:
        """Joints and motors alike."""
        return {
            item: value + p.position_noise * noise[item] if item in POSITIONS else value for item, value in y.items()
        }


class VelocityNoise(Effect):
    """White noise on measured rates."""

    name, sampled, noisy = "velocity_noise", True, True
    parameters = (
        Parameter(
            "velocity_noise", "{q}/s", 0.0, "standard deviation of the noise on a measured rate", NON_NEGATIVE, True
        ),
    )

    def sense(self, y: Measured, p: Values, noise: Measured) -> Measured:
        """Joints and motors alike."""
        return {item: value + p.velocity_noise * noise[item] if item in RATES else value for item, value in y.items()}


class PositionResolution(Effect):
    """Encoders show the nearest of their steps."""

    name, sampled = "position_resolution", True
    parameters = (
        Parameter(
            "position_resolution", "{q}", 0.0, "step between two positions that can be shown", NON_NEGATIVE, True
        ),
    )

    def sense(self, y: Measured, p: Values, noise: Measured) -> Measured:
        """Joints and motors alike; a joint of resolution 0 shows its position as it is."""
        step = p.position_resolution
        safe = step + (step == 0.0)  # not to divide by zero, whose guard would still let NaN be computed

        def shown(value: ca.SX) -> ca.SX:
            return ca.if_else(step > 0.0, step * ca.floor(value / safe + 0.5), value)

        return {item: shown(value) if item in POSITIONS else value for item, value in y.items()}


SENSORS: tuple[Effect, ...] = (
    PositionNoise(),
    VelocityNoise(),
    PositionResolution(),
)
"""What [sensor] has, in the order in which it acts: an encoder's steps are of what noise has moved."""


class RateLimit(Effect):
    """A command that cannot jump; it remembers what it let through in the last step."""

    name, table, sampled = "rate_limit", "actuator", True
    parameters = (Parameter("rate_limit", "{F}/s", math.inf, "largest rate of a motor's command", LIMIT, True),)


class Lag(Effect):
    """A motor whose force follows its command with a time constant; it remembers the force."""

    name, table, sampled = "lag", "actuator", True
    parameters = (Parameter("lag", "s", 0.0, "time constant of a motor's force", NON_NEGATIVE, True),)


ACTUATORS: tuple[Effect, ...] = (RateLimit(), Lag())
"""What [actuator] has that remembers one number a joint, in the order in which it acts, behind the delay."""

LONGEST_DELAY = 1000
"""Steps: each is a command to be remembered."""

EFFECTS: dict[str, Effect] = {effect.name: effect for effect in (*SENSORS, *ACTUATORS)}


def sensed(names: Iterable[str], y: Measured, p: Values, noise: Measured) -> Measured:
    """The state as the controller sees it."""
    for name in names:
        y = EFFECTS[name].sense(y, p, noise)
    return y


def actuated(names: Iterable[str], u: ca.SX) -> ca.SX:
    """The command as the plant feels it: what every effect delays, then what the motors make of it."""
    chosen = [EFFECTS[name] for name in names]
    for effect in chosen:
        u = effect.delay(u)
    for effect in chosen:
        u = effect.actuate(u)
    return u


def acting(
    names: Iterable[str],
    command: ca.SX,
    memory: Mapping[str, ca.SX],
    step: ca.SX,
    nodes: Sequence[Number],
    p: Values,
) -> tuple[list[ca.SX], dict[str, ca.SX]]:
    """What the motors are driven by in a step, at its nodes, and what is remembered after it; n x 1 each.

    command  that arrives, constant over the step;  memory  by the effect's name, zero at the start
    A lag is solved and not integrated: with a constant command its force is an exponential.
    """
    names, after = tuple(names), {}
    if RateLimit.name in names:
        last, most = memory[RateLimit.name], p.rate_limit * step
        command = after[RateLimit.name] = ca.fmin(ca.fmax(command, last - most), last + most)
    if Lag.name not in names:
        return [command] * len(nodes), after
    force, tau = memory[Lag.name], p.lag
    safe = tau + (tau == 0.0)

    def at(node: Number) -> ca.SX:
        then = force if node == 0 else command + (force - command) * ca.exp(-float(node) * step / safe)
        return ca.if_else(tau > 0.0, then, command)

    after[Lag.name] = at(1.0)
    return [at(node) for node in nodes], after
