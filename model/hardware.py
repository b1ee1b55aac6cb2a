"""Hardware between plant and controller: what the sensors show of the state, what the motors make of the command.

The loop is described once, in this order:

    signals -> sense -> control -> hold -> actuate -> plant

An effect stands at `sense` or `actuate`. Those that a structure names are part of its Functions, and so of all that is
printed from them: the batch kernel, the exported C, FMUs and test vectors. What no structure names is nowhere printed.
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

    def actuate(self, u: ca.SX) -> ca.SX:
        """The motor force that acts when u (n x 1) is commanded."""
        return u


EFFECTS: dict[str, Effect] = {}


def sensed(names: Iterable[str], y: Measured) -> Measured:
    """The state as the controller sees it."""
    for name in names:
        y = EFFECTS[name].sense(y)
    return y


def actuated(names: Iterable[str], u: ca.SX) -> ca.SX:
    """The command as the plant feels it."""
    for name in names:
        u = EFFECTS[name].actuate(u)
    return u
