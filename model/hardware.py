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
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import casadi as ca

from springline.model.quantities import Quantity

Measured = Mapping[Quantity, ca.SX]


class Effect:
    """One property of real sensors or motors; a subclass overrides what it changes.

    name  in a Structure
    """

    name: str

    def sense(self, y: Measured) -> Measured:
        """What is shown in place of y, n x 1 each."""
        return y

    def delay(self, u: ca.SX) -> ca.SX:
        """The command that arrives at the motors when u (n x 1) is commanded."""
        return u

    def actuate(self, u: ca.SX) -> ca.SX:
        """The motor force that acts when u (n x 1) arrives."""
        return u


EFFECTS: dict[str, Effect] = {}


def sensed(names: Iterable[str], y: Measured) -> Measured:
    """The state as the controller sees it."""
    for name in names:
        y = EFFECTS[name].sense(y)
    return y


def actuated(names: Iterable[str], u: ca.SX) -> ca.SX:
    """The command as the plant feels it: what every effect delays, then what the motors make of it."""
    chosen = [EFFECTS[name] for name in names]
    for effect in chosen:
        u = effect.delay(u)
    for effect in chosen:
        u = effect.actuate(u)
    return u
