"""Which kernel: a KernelSpec says all that decides its bits, and how it is printed and compiled."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, get_args

from springline.codegen.kernel.paying import Span
from springline.codegen.kernel.toolchain import Compiler
from springline.codegen.nearest import nearest
from springline.codegen.numbers import real, whole
from springline.model.hardware import EFFECTS
from springline.model.structure import Structure
from springline.model.system import system_of

Engine = Literal["lanes", "casadi"]

_MOST = 64  # lanes, groups and packs: far beyond what pays


@dataclass(frozen=True, slots=True)
class KernelOptions:
    """How a kernel is printed and compiled; none of it changes a bit of the results.

    engine   "lanes" or "casadi" (the reference, one run at a time, every parameter tunable)
    width    lanes in a vector, None for the machine's; a run alone has use for no more than 4
    groups   vectors worked on at once to hide latency, None for what pays
    span     what is printed as one block: "evaluation", "stage" or "step", None for what pays
    packs    so many times width x groups runs go through time side by side, None for what pays
    alone    one run at a time: all lanes repeat it, or two of its joints lie side by side in them
    paired   whether joints lie side by side where a run is alone, None for what pays
    flags    optimisation flags, None for the best this machine can do
    compiler  None for the one that is found
    Raises ValueError for an unknown engine, and for counts that no kernel can have.
    """

    engine: Engine = "lanes"
    width: int | None = None
    groups: int | None = None
    span: Span | None = None
    packs: int | None = None
    alone: bool = False
    paired: bool | None = None
    flags: tuple[str, ...] | None = None
    compiler: Compiler | None = None

    def __post_init__(self) -> None:
        if self.engine not in get_args(Engine):
            raise ValueError(f"engine is {self.engine!r}, expected one of {', '.join(get_args(Engine))}")
        if self.span not in (None, *get_args(Span)):
            raise ValueError(f"span is {self.span!r}, expected one of {', '.join(get_args(Span))}")
        for name in ("width", "groups", "packs"):
            if getattr(self, name) is not None:
                whole(name, getattr(self, name), 1, _MOST)
        if self.width is not None and self.width & (self.width - 1):
            raise ValueError(f"width is {self.width}, expected a power of two")
        if self.alone and self.width not in (None, 2, 4):
            raise ValueError(f"width is {self.width}, expected 2 or 4 for a run alone")
        if self.alone and self.groups not in (None, 1):
            raise ValueError(f"groups is {self.groups}, expected 1 for a run alone")
        if self.paired and not self.alone:
            raise ValueError("paired is True, expected alone to be, too")


ONE_RUN = KernelOptions(alone=True)
"""For a run by itself. Idle lanes cost nothing, and in vector registers the bits of a double are at hand, without a
detour through integer registers."""


@dataclass(frozen=True, slots=True)
class KernelSpec:
    """One kernel. Equal specs are one and the same, so every cache of kernels has them as keys.

    structure  what the system consists of
    sampled    control once per sample (zero-order hold) instead of in every stage
    tunable    slot keys that each run may set for itself, None for all; the others are constants. In slots' order
    baked      values of all slots, in their order, of which those of tunable slots are not used; () if all are tunable
    options    how it is printed and compiled: all else decides the bits, this does not

    Constants are compared by their bits: 0.0 and -0.0 are equal numbers and make two kernels.
    Raises ValueError, with the name and what was expected, for what fits neither the structure nor the engine.
    """

    structure: Structure
    sampled: bool = False
    tunable: tuple[str, ...] | None = None
    baked: tuple[float, ...] = field(default=(), compare=False)
    options: KernelOptions = KernelOptions()
    _constant_bits: bytes = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not self.sampled and self.structure.delay:
            raise ValueError("a delay is of samples: expected a control that is sampled")
        if not self.sampled and self.structure.differenced:
            raise ValueError("differenced rates are of samples: expected a control that is sampled")
        if not self.sampled and (effects := [name for name in self.structure.effects if EFFECTS[name].sampled]):
            raise ValueError(f"effect {effects[0]!r} is one of samples: expected a control that is sampled")
        if self.tunable is None:
            if self.baked:
                raise ValueError(f"baked has {len(self.baked)} values, expected none where every parameter is tunable")
        else:  # only here, for a system is symbolic work, which threads that run kernels must not do
            keys = _slot_keys(self.structure)
            if self.options.engine == "casadi":
                raise ValueError("the casadi engine bakes no parameter: expected tunable = None")
            for key in self.tunable:
                if key not in keys:
                    near = nearest(key, keys, 0.0)
                    raise ValueError(f"no parameter {key!r} to be tunable; the nearest name is {near!r}")
            if len(self.baked) != len(keys):
                raise ValueError(f"baked has {len(self.baked)} values, expected {len(keys)}, one a parameter")
            numbers = (real(f"baked {key}", value, infinite=True) for key, value in zip(keys, self.baked, strict=True))
            object.__setattr__(self, "baked", tuple(numbers))
            object.__setattr__(self, "tunable", tuple(key for key in keys if key in set(self.tunable)))
        constants = self.constants.values()
        object.__setattr__(self, "_constant_bits", struct.pack(f"{len(constants)}d", *constants))

    @property
    def constants(self) -> dict[str, float]:
        """Slot key -> value of what is baked, in the slots' order."""
        if self.tunable is None:
            return {}
        tunable, keys = set(self.tunable), _slot_keys(self.structure)
        return {key: value for key, value in zip(keys, self.baked, strict=True) if key not in tunable}


@lru_cache(maxsize=512)
def _slot_keys(structure: Structure) -> tuple[str, ...]:
    return tuple(slot.key for slot in system_of(structure).slots)
