"""The controllers that a structure can name."""

from __future__ import annotations

from springline.model.control.controller import Controller, check_controller
from springline.model.control.terminal_sliding import TerminalSliding
from springline.model.registry import Registry

CONTROLLERS: Registry[Controller] = Registry(
    Controller, {item.name: item for item in (TerminalSliding(),)}, check_controller
)
