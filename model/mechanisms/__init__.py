"""Mechanisms by name. A new one is one module with two energies and one line here."""

from __future__ import annotations

from springline.model.mechanism import Mechanism
from springline.model.mechanisms.transfer_manipulator import TransferManipulator

MECHANISMS: dict[str, Mechanism] = {mechanism.name: mechanism for mechanism in (TransferManipulator(),)}
