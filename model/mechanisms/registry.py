"""Mechanisms by name. A new one is one module and one line here, or a user's own file."""

from __future__ import annotations

from springline.model.mechanisms.mechanism import Mechanism, check_mechanism
from springline.model.mechanisms.planar_arm import PlanarArm
from springline.model.mechanisms.transfer_manipulator import TransferManipulator
from springline.model.registry import Registry

MECHANISMS: Registry[Mechanism] = Registry(
    Mechanism, {item.name: item for item in (TransferManipulator(), PlanarArm())}, check_mechanism
)
