"""Mechanisms by name. A new one is one module with two energies and one line here, or a user's own file."""

from __future__ import annotations

from springline.model.mechanisms.mechanism import Mechanism, check_mechanism
from springline.model.mechanisms.transfer_manipulator import TransferManipulator
from springline.model.registry import Registry

MECHANISMS: Registry[Mechanism] = Registry(
    Mechanism, {item.name: item for item in (TransferManipulator(),)}, check_mechanism
)
