"""A Kernel: the loop compiled with a Program, loaded, and called with arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springline.codegen.kernel import toolchain
from springline.codegen.kernel.job import Job, Struct
from springline.codegen.kernel.metrics import BANDS
from springline.codegen.kernel.runs import METRICS, STATUS, Runs
from springline.codegen.kernel.settings import LoopSettings
from springline.codegen.kernel.source import KernelSource, print_kernel
from springline.codegen.kernel.spec import KernelSpec
from springline.codegen.memory import memory
from springline.codegen.numbers import doubles, shown
from springline.codegen.program import Program, SignalTable, program
from springline.model.structure import TableLayout
from springline.model.system import System

Floats = NDArray[np.float64]


class LayoutError(RuntimeError):
    """The compiled loop and this file do not agree on what is where in memory."""


@dataclass
class Watch:
    """Shared with running calls from another thread: `progress` counts steps x runs, setting `stop` ends them early."""

    progress: ctypes.c_int64 = field(default_factory=ctypes.c_int64)
    stop: ctypes.c_int32 = field(default_factory=ctypes.c_int32)


class _Table(Struct):
    _fields_ = (
        ("t0", ctypes.c_double),
        ("dt", ctypes.c_double),
        ("intervals", ctypes.c_int64),
        ("channels", ctypes.c_int64),
        ("periodic", ctypes.c_int64),
        ("coefficients", ctypes.c_void_p),
    )


# What springline_layout says, in its order.
_LAYOUT = (
    "runs side by side",
    "bytes of a job",
    "bytes of a table",
    "parameters of a run",
    "bands of a run",
    "tables",
    "states",
    "metrics",
    "columns of a trajectory",
    "statuses",
)


@dataclass(frozen=True, slots=True)
class Shape:
    """What there is of everything that a loop takes and gives: all that a compiled one need know of its System.

    columns  of a trajectory;  tables: the signal tables that it reads;  delay: most steps that commands take to arrive
    """

    joints: int
    states: int
    columns: int
    tables: tuple[TableLayout, ...]
    delay: int = 0

    @classmethod
    def of(cls, system: System) -> Shape:
        """The Shape of a System's loop."""
        states = system.x.numel() + system.z.numel()
        return cls(system.n, states, len(system.trajectory), system.tables, system.structure.delay)


class Kernel:
    """The compiled loop of one Program.

    shape       of what it was printed from
    parameters  slot keys in the order of the columns that `run` takes
    width       runs that are simulated together (lanes x groups x packs)
    library     the shared library, in the cache
    Raises LayoutError if the C does not have the sizes that this file reads and writes, ToolchainError.
    """

    def __init__(self, shape: Shape, source: KernelSource, compiler: toolchain.Compiler | None = None) -> None:
        self.shape = shape
        self.parameters = source.parameters
        self.library = toolchain.build_library(dict(source.files), main="loop.c", flags=source.flags, compiler=compiler)
        handle = toolchain.load(self.library)
        self._simulate: Any = handle.springline_simulate
        self._simulate.restype = None
        self.width = _checked_layout(
            handle.springline_layout,
            ctypes.sizeof(Job),
            ctypes.sizeof(_Table),
            len(self.parameters),
            len(BANDS),
            len(shape.tables),
            shape.states,
            shape.joints * len(METRICS),
            shape.columns,
            len(STATUS),
        )

    def run(
        self,
        parameters: Floats,
        settings: LoopSettings,
        tables: Sequence[SignalTable] = (),
        *,
        numbers: Sequence[int] | None = None,
        bands: Floats | None = None,
        watch: Watch | None = None,
    ) -> Runs:
        """Simulate one run per row of `parameters` (runs, len(self.parameters)), in this thread, without the GIL.

        numbers  of the runs, 0 or more, which the noise of sensors goes by; None for 0 in all of them
        bands    (runs, len(BANDS)), what the metrics of each take for settled; None for those of the settings in all
        Raises ValueError if `parameters` or `tables` do not have the shape the kernel was built for, and for results
        that this machine's memory cannot hold; TypeError or ValueError for numbers that are no doubles.
        """
        parameters = doubles(parameters)
        runs = len(parameters) if parameters.ndim else 0
        if parameters.shape != (runs, len(self.parameters)):
            raise ValueError(f"parameters have shape {parameters.shape}, expected (runs, {len(self.parameters)})")
        layouts = self.shape.tables
        if len(tables) != len(layouts):
            raise ValueError(f"{len(tables)} tables given, the system has {len(layouts)}")
        c_tables = (_Table * max(len(tables), 1))()
        coefficients = [doubles(table.coefficients) for table in tables]
        for i, (table, layout, data) in enumerate(zip(tables, layouts, coefficients, strict=True)):
            if data.shape[1:] != (len(layout.channels), 4):
                raise ValueError(
                    f"table {layout.signal}: coefficients have shape {data.shape}, "
                    f"expected (intervals, {len(layout.channels)}, 4)"
                )
            c_tables[i] = _Table(
                t0=table.t0,
                dt=table.dt,
                intervals=data.shape[0],
                channels=data.shape[1],
                periodic=int(table.periodic),
                coefficients=data.ctypes.data,
            )
        if len(settings.limits) not in (0, self.shape.joints):
            raise ValueError(
                f"limits has {len(settings.limits)} pairs, expected one for each of {self.shape.joints} joints"
            )
        delay = self.shape.delay if settings.delay is None else settings.delay
        if delay > self.shape.delay:
            raise ValueError(f"delay is {delay}, expected at most the {self.shape.delay} steps of the structure")
        limits = np.array(settings.limits, dtype=np.float64)
        counted = np.zeros(runs, np.int64) if numbers is None else np.array(numbers, dtype=np.int64)
        if counted.shape != (runs,) or np.any(counted < 0):
            raise ValueError(f"numbers are {shown(numbers)}, expected one of 0 or more for each of {runs} runs")
        judged = np.tile(settings.bands, (runs, 1)) if bands is None else doubles(bands)
        if judged.shape != (runs, len(BANDS)) or not np.all(np.isfinite(judged)):
            raise ValueError(f"bands have shape {judged.shape}, expected ({runs}, {len(BANDS)}) finite numbers")
        rows = settings.rows
        needed, there = 8 * runs * rows * self.shape.columns, memory()
        if needed > there:
            raise ValueError(
                f"output_every is {settings.output_every}: {runs} x {rows} trajectory rows of {self.shape.columns} "
                f"numbers need {needed / 1e9:.3g} GB of memory, and there are {there / 1e9:.3g}"
            )
        result = Runs(
            metrics=np.full((runs, self.shape.joints, len(METRICS)), np.nan),
            final_state=np.zeros((runs, self.shape.states)),
            end_time=np.zeros(runs),
            status=np.zeros(runs, np.int32),
            quantity=np.full(runs, -1, np.int32),
            trajectory=np.full((runs, rows, self.shape.columns), np.nan) if rows else None,
            rows=np.zeros(runs, np.int64) if rows else None,
        )
        job = Job(
            first=0,
            last=runs,
            steps=settings.steps,
            start_time=settings.start_time,
            step=settings.step,
            bound=settings.bound,
            limits=limits.ctypes.data if limits.size else None,
            hold=settings.hold,
            delay=delay,
            output_every=settings.output_every,
            seed=settings.seed,
            numbers=None if numbers is None else counted.ctypes.data,
            parameters=parameters.ctypes.data,
            bands=judged.ctypes.data,
            tables=ctypes.addressof(c_tables),
            metrics=result.metrics.ctypes.data,
            final_state=result.final_state.ctypes.data,
            end_time=result.end_time.ctypes.data,
            status=result.status.ctypes.data,
            quantity=result.quantity.ctypes.data,
            trajectory=result.trajectory.ctypes.data if result.trajectory is not None else None,
            rows=result.rows.ctypes.data if result.rows is not None else None,
            capacity=rows,
            progress=ctypes.addressof(watch.progress) if watch else None,
            stop=ctypes.addressof(watch.stop) if watch else None,
        )
        self._simulate(ctypes.byref(job))
        return result


def _checked_layout(layout: Any, *expected: int) -> int:
    """How many runs go side by side, once the loop's sizes are those `expected`. Raises LayoutError if they are not."""
    layout.restype = ctypes.c_int64
    layout.argtypes = [ctypes.c_void_p, ctypes.c_int64]
    sizes = (ctypes.c_int64 * len(_LAYOUT))()
    count = layout(sizes, len(_LAYOUT))
    wrong = [
        f"{name}: {found}, expected {size}"
        for name, found, size in zip(_LAYOUT[1:], sizes[1:], expected, strict=True)
        if found != size
    ]
    if count != len(_LAYOUT):
        wrong = [f"sizes: {count}, expected {len(_LAYOUT)}"]
    if wrong:
        raise LayoutError(f"loop.c and compiled.py do not fit together ({'; '.join(wrong)}): install springline anew")
    return int(sizes[0])


def compile_kernel(program: Program, spec: KernelSpec) -> Kernel:
    """Print and compile the Kernel of a Program; see `print_kernel`. Raises ToolchainError."""
    return Kernel(Shape.of(program.system), print_kernel(program, spec), spec.options.compiler)


@lru_cache(maxsize=64)
def kernel(spec: KernelSpec) -> Kernel:
    """The Kernel of a spec, compiled on first need and then remembered.

    Raises ToolchainError when there is no C compiler or it fails.
    """
    return compile_kernel(program(spec.structure), spec)
