"""What one kernel does for many runs: the same Work runs in a thread here or in a worker process elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
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
from springline.runner.scenario import Scenario, Slots, kernel_tables, per_run

Floats = NDArray[np.float64]


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

    def chosen(self, slots: Slots, runs: int) -> Floats:
        """What each run takes of `slots`, (runs, parameters)."""
        for key, value in self.spec.constants.items():
            if not np.all(slots[key] == value):
                raise AssertionError(f"{key}, which was taken for constant, varies")
        return per_run(slots, self.parameters, runs)


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


def work_for(scenario: Scenario, slots: Slots) -> Work:
    """The Work of a scenario's runs: a slot in which they differ is tunable, any other is baked."""
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
    parameters: Floats,
    kept: Sequence[int] = (),
    watch: Watch | None = None,
    first: int = 0,
) -> Outcome:
    """Simulate one run per row of `parameters`, in this thread; those at `kept` with their trajectory.

    The number of a run, by which noise goes, is `first` for the first row, and one more for each other.

    A kept run is simulated twice, for a trajectory slows a whole pack down; the bits are the same. `watch` counts the
    first time and stops either.
    """
    numbers = range(first, first + len(parameters))
    runs = loop.run(parameters, replace(settings, output_every=0), tables, numbers=numbers, watch=watch)
    again = None if watch is None else Watch(stop=watch.stop)
    trajectories: list[Floats] = []
    for begin in range(0, len(kept), loop.width):
        some = list(kept[begin : begin + loop.width])
        pack = loop.run(parameters[some], settings, tables, numbers=[numbers[i] for i in some], watch=again)
        assert pack.trajectory is not None and pack.rows is not None
        trajectories += [rows[:count].copy() for rows, count in zip(pack.trajectory, pack.rows, strict=True)]
    return Outcome(runs, tuple(trajectories))


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


def perform_parcel(parcel: Parcel, parameters: Floats, kept: Sequence[int] = (), first: int = 0) -> Outcome:
    """`perform` in a worker: its kernel is compiled from the parcel's sources once, then taken from its cache.

    Raises ValueError if the sources are not those that were sent, ToolchainError if they cannot be compiled here.
    """
    return perform(_received(parcel), parcel.settings, parcel.tables, parameters, kept, first=first)


_received_kernels: dict[str, Kernel] = {}


def _received(parcel: Parcel) -> Kernel:
    if parcel.source.hash != parcel.hash:
        raise ValueError("the kernel's sources were damaged on the way to this worker")
    with _COMPILING:
        if parcel.hash not in _received_kernels:
            _received_kernels[parcel.hash] = Kernel(parcel.shape, parcel.source)
        return _received_kernels[parcel.hash]
