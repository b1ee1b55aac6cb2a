"""The controllers that a structure can name."""

from __future__ import annotations

from springline.model.control.computed_torque import ComputedTorque
from springline.model.control.controller import Controller, check_controller
from springline.model.control.nonsingular_terminal import NonsingularTerminal
from springline.model.control.super_twisting import SuperTwisting
from springline.model.control.terminal_sliding import TerminalSliding
from springline.model.registry import Registry

_PACKAGED = (
    TerminalSliding(),
    ComputedTorque(),
    SuperTwisting(),
    NonsingularTerminal(),
)

CONTROLLERS: Registry[Controller] = Registry(Controller, {item.name: item for item in _PACKAGED}, check_controller)
