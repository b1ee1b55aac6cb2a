"""Hardware between plant and controller: what the sensors show of the state, what the motors make of the command.

The loop is described once, in this order:

    signals -> sense -> control -> hold -> delay -> actuate -> plant

`control` is the controller with its limit U_max, and its states z (model/control/) go on where the command does:
in every stage, or once a sample. An effect stands at `sense`, `delay` or `actuate`. Those that a structure names are
part of its Functions, and so of all that is printed from them: the batch kernel, the exported C, FMUs and test vectors.
What no structure names is nowhere printed.

What an effect remembers belongs to the plant, not to the controller: entries behind the plant's own in
springline_state, set by springline_start and moved on by springline_plant_step. A lag is integrated with the plant. The
line of a delay is moved on once a step, at its end: it is no part of the differential equation, so in the loop it
stands where a sampled controller's z does, behind the states that are integrated. No effect that remembers is there
yet.

Random numbers are no state: they follow from a seed and from the numbers of run, sample and channel, which is the place
in the state of what they are added to. Functions take them as an input, noise; codegen/runtime/sl_noise.h makes them,
for both engines and all that is exported.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

import casadi as ca

from springline.model.parameters import NON_NEGATIVE, Parameter, Values
from springline.model.quantities import DQ1, DQ2, Q1, Q2, Quantity

Measured = Mapping[Quantity, ca.SX]

POSITIONS, RATES = (Q1, Q2), (DQ1, DQ2)


class Effect:
    """One property of real sensors or motors; a subclass overrides what it changes.

    name        in a Structure
    parameters  its numbers, keys of [sensor]; it is there where one of them is not zero
    sampled     whether it is one of samples, which continuous control has none of
    noisy       whether it takes a random number for each quantity of the state and each sample
    """

    name: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    sampled: ClassVar[bool] = False
    noisy: ClassVar[bool] = False

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
        Parameter("position_noise", "{q}", 0.0, "standard deviation of a measured position", NON_NEGATIVE, True),
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
        Parameter("velocity_noise", "{q}/s", 0.0, "standard deviation of a measured rate", NON_NEGATIVE, True),
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


SENSORS: tuple[Effect, ...] = (PositionNoise(), VelocityNoise(), PositionResolution())
"""What [sensor] has, in the order in which it acts: an encoder's steps are of what noise has moved."""

EFFECTS: dict[str, Effect] = {effect.name: effect for effect in SENSORS}


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
