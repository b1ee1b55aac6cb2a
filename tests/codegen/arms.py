"""Structures and numbers of any arm on a base that moves, for tests of the generated code."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from springline.codegen.program import program
from springline.model.mechanisms import MECHANISMS
from springline.model.structure import SignalShape, Structure


def structure_of(mechanism: str, **changes: Any) -> Structure:
    arm = MECHANISMS[mechanism].of_size(changes.get("size", 0))
    terms = tuple(len(t) for t in arm.reference_terms)
    given = {"reference": SignalShape("sine", terms), "base_motion": SignalShape("sine", (1, 1, 1))} | changes
    return Structure(mechanism=mechanism, **given)


def values_of(structure: Structure, others: Mapping[str, float] = MappingProxyType({})) -> np.ndarray:
    """The mechanism's own reference and start, under a base that moves; U_max low enough to limit now and then.

    others: of the parameters with these keys.
    """
    arm = MECHANISMS[structure.mechanism].of_size(structure.size)
    given = {"base_motion.heave.0.amplitude": 0.1, "base_motion.heave.0.omega": 9.0,
             "base_motion.pitch.0.amplitude": 0.05, "base_motion.pitch.0.omega": 3.0}  # fmt: skip
    given |= {f"base_motion.{key}.0.amplitude": 0.2 for key in ("surge", "sway", "yaw")}
    given |= {f"base_motion.{key}.0.omega": 5.0 for key in ("surge", "sway", "yaw")}
    given |= {f"base_motion.mount.{i}": value for i, value in enumerate((4.0, 2.0, -1.5))}
    given |= {f"base_motion.mount_rpy.{i}": value for i, value in enumerate((0.2, -0.1, 0.7))}
    slots = program(structure).system.slots
    given |= {slot.key: 0.3 for slot in slots if slot.key.split(".")[1] in structure.friction}
    for i, joint in enumerate(arm.joints):
        given |= {f"initial.q.{i}": arm.start_position[i], f"reference.{joint.name}.offset": arm.reference_offset[i]}
        for k, term in enumerate(arm.reference_terms[i]):
            stem = f"reference.{joint.name}.terms.{k}"
            given |= {f"{stem}.amplitude": term.amplitude, f"{stem}.omega": term.omega, f"{stem}.phase": term.phase}
    given |= others
    return np.array([given.get(slot.key, slot.default) for slot in slots])
