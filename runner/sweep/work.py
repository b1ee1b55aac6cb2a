"""What one kernel does for many runs: the same Work runs in a thread here or in a worker process elsewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from springline.codegen.files import canonical_json
from springline.codegen.kernel import (
    Kernel,
    KernelSource,
    KernelSpec,
    LoopSettings,
    Runs,
    Shape,
    Watch,
    kernel,
    lanes,
    print_kernel,
    runtime_sources,
    tokens,
)
from springline.codegen.program import SignalTable, program
from springline.model.system import System
from springline.runner.run import kernel_structure, loop_settings
from springline.runner.scenario import Scenario, kernel_tables, per_run

Floats = NDArray[np.float64]

TRAJECTORY_BYTES = 64e6
"""Of the trajectories that a chunk gives, about."""


@dataclass(frozen=True, eq=False, slots=True)
class Inputs:
    """What runs of a Work take.

    parameters  (runs, parameters), in the order of the kernel's
    numbers     of the runs, by which noise goes
    bands       (runs, bands), what the metrics of each take for settled; None for those of the Work's settings in all
    """

    parameters: Floats
    numbers: Sequence[int]
    bands: Floats | None = None

    def __len__(self) -> int:
        return len(self.numbers)

    def take(self, places: Sequence[int]) -> Inputs:
        """Those of the runs at these places."""
        bands = None if self.bands is None else self.bands[places]
        return Inputs(self.parameters[places], [self.numbers[k] for k in places], bands)


@dataclass(frozen=True, eq=False)
class Work:
    """Runs of one structure and timing that differ in the tunable slots alone. Each is equal to itself only.

    spec      of the kernel: what varies is tunable, the rest baked
    settings  of the loop, with the rows of a trajectory (which only kept runs write)
    """

    spec: KernelSpec
    settings: LoopSettings
    tables: tuple[SignalTable, ...]

    @property
    def system(self) -> System:
        """The System of the structure."""
        return program(self.spec.structure).system

    @property
    def parameters(self) -> tuple[str, ...]:
        """Slot keys in the order of the columns that a run takes; a tunable slot that nothing reads has none."""
        return _emitted(self.spec)[1]

    @property
    def identity(self) -> str:
        """Hash of all that decides the bits of the results, the same on every machine (whatever its vector width).

        Of the C it takes the tokens: who resumes a dataset after a comment was edited gets the same bits.
        """
        return _emitted(self.spec)[0]

    def kernel(self) -> Kernel:
        """The kernel, compiled on first need. Raises ToolchainError."""
        with _COMPILING:
            return kernel(self.spec)

    def inputs(self, scenario: Scenario, columns: Mapping[str, Floats], numbers: Sequence[int]) -> Inputs:
        """What the runs with these numbers take; `columns` as for Scenario.slots_for, which raises InputError."""
        slots = scenario.slots_for(columns)
        for key, value in self.spec.constants.items():
            if not np.all(slots[key] == value):
                raise AssertionError(f"{key}, which was taken for constant, varies")
        return Inputs(per_run(slots, self.parameters, len(numbers)), numbers, scenario.bands_for(columns))


# Several threads want the first chunk's kernel at once, and CasADi is not made for that.
_COMPILING = Lock()


@lru_cache(maxsize=512)
def _emitted(spec: KernelSpec) -> tuple[str, tuple[str, ...]]:
    """Identity and parameters of a kernel, whatever its options."""
    emission = lanes.emit(program(spec.structure), spec.constants)
    text = canonical_json({**_runtime_tokens(), "kernel.h": tokens(emission.text), "sampled": spec.sampled})
    return sha256(text).hexdigest(), emission.tunable


@lru_cache(maxsize=1)
def _runtime_tokens() -> dict[str, list[str]]:
    return {name: tokens(text) for name, text in runtime_sources().items()}


def work_for(scenario: Scenario, columns: Mapping[str, Floats]) -> Work:
    """The Work of runs with these `columns`, as for Scenario.slots_for, which raises InputError.

    A slot in which they differ is tunable, any other is baked.
    """
    slots = scenario.slots_for(columns)
    spec = KernelSpec(
        kernel_structure(scenario),
        scenario.control_every > 0,
        tuple(key for key, values in slots.items() if np.any(values != np.ravel(values)[0])),
        tuple(float(np.ravel(values)[0]) for values in slots.values()),
    )
    return Work(spec, loop_settings(scenario, trajectory=True), tuple(kernel_tables(scenario.tables())))


def kernel_identity(scenario: Scenario) -> str:
    """`Work.identity` of the kernel that simulates a scenario by itself, in which every number is tunable."""
    return _emitted(KernelSpec(kernel_structure(scenario), scenario.control_every > 0))[0]


@dataclass(frozen=True)
class Outcome:
    """Results of a chunk: the Runs of all, and of each kept run its trajectory (rows, columns)."""

    runs: Runs
    trajectories: tuple[Floats, ...] = ()


def perform(
    loop: Kernel,
    settings: LoopSettings,
    tables: Sequence[SignalTable],
    inputs: Inputs,
    kept: Sequence[int] = (),
    watch: Watch | None = None,
) -> Outcome:
    """Simulate runs in this thread; those at the places `kept` with their trajectory.

    Where some are kept, these are simulated twice, for a trajectory slows a whole pack down; the bits are the same.
    `watch` counts the first time and stops either.
    """

    def call(given: Inputs, output_every: int, watch: Watch | None) -> Runs:
        told = replace(settings, output_every=output_every)
        return loop.run(given.parameters, told, tables, numbers=given.numbers, bands=given.bands, watch=watch)

    if kept and len(kept) == len(inputs):
        runs = call(inputs, settings.output_every, watch)
        return Outcome(replace(runs, trajectory=None, rows=None), _written(runs))
    runs = call(inputs, 0, watch)
    again = None if watch is None else Watch(stop=watch.stop)
    trajectories: list[Floats] = []
    for begin in range(0, len(kept), loop.width):
        trajectories += _written(call(inputs.take(kept[begin : begin + loop.width]), settings.output_every, again))
    return Outcome(runs, tuple(trajectories))


def _written(runs: Runs) -> tuple[Floats, ...]:
    """Of each run the rows of its trajectory that were written."""
    assert runs.trajectory is not None and runs.rows is not None
    return tuple(rows[:count].copy() for rows, count in zip(runs.trajectory, runs.rows, strict=True))


@dataclass(frozen=True)
class Parcel:
    """A Work as it travels to a worker: the kernel's sources, with their hash, instead of a compiled library.

    Nothing of a model is built there, so a worker needs no file of the user's, and runs none.
    """

    shape: Shape
    source: KernelSource
    hash: str
    settings: LoopSettings
    tables: tuple[SignalTable, ...]


@lru_cache(maxsize=16)
def parcel(work: Work) -> Parcel:
    """Pack a Work. Raises ToolchainError where there is no compiler to say how wide vectors are."""
    with _COMPILING:
        source = print_kernel(program(work.spec.structure), work.spec)
    return Parcel(Shape.of(work.system), source, source.hash, work.settings, work.tables)


def perform_parcel(parcel: Parcel, inputs: Inputs, kept: Sequence[int] = ()) -> Outcome:
    """`perform` in a worker: its kernel is compiled from the parcel's sources once, then taken from its cache.

    Raises ValueError if the sources are not those that were sent, ToolchainError if they cannot be compiled here.
    """
    return perform(_received(parcel), parcel.settings, parcel.tables, inputs, kept)


_received_kernels: dict[str, Kernel] = {}


def _received(parcel: Parcel) -> Kernel:
    if parcel.source.hash != parcel.hash:
        raise ValueError("the kernel's sources were damaged on the way to this worker")
    with _COMPILING:
        if parcel.hash not in _received_kernels:
            _received_kernels[parcel.hash] = Kernel(parcel.shape, parcel.source)
        return _received_kernels[parcel.hash]
