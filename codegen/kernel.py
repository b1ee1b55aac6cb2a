"""A Kernel: the loop compiled with a Program, loaded, and called with arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springline.codegen import toolchain
from springline.codegen.job import STATUSES, Job, Struct
from springline.codegen.kernel_source import KernelSource, print_kernel
from springline.codegen.kernel_spec import ONE_RUN, Engine, KernelOptions, KernelSpec
from springline.codegen.memory import memory
from springline.codegen.numbers import doubles, real, whole
from springline.codegen.program import Program, program
from springline.codegen.tables import Table
from springline.model import quantities
from springline.model.system import System, TableLayout

__all__ = [
    "CHATTERING",
    "METRICS",
    "MOST_STEPS",
    "ONE_RUN",
    "STATUS",
    "Engine",
    "Kernel",
    "KernelOptions",
    "KernelSpec",
    "LayoutError",
    "LoopSettings",
    "Runs",
    "Table",
    "Watch",
    "chatters",
    "compile_kernel",
    "joined",
    "kernel",
    "quantity_name",
]

Floats = NDArray[np.float64]

METRICS = tuple(metric.name for metric in quantities.METRICS)
"""Names of the metrics of each joint, in their order."""

STATUS = tuple(STATUSES)
"""How a run ends, by number."""

CHATTERING = 20.0
"""1/s: a command whose `chatter` is larger chatters. Clean runs have 0 to 1.3."""
_SWINGS = 4.0  # so many at least, or the one swing of a run that lasts no time would be taken for many in a second

MOST_STEPS = 2**53
"""Steps are counted in doubles too, and these hold no more whole numbers without a gap."""


class LayoutError(RuntimeError):
    """The compiled loop and this file do not agree on what is where in memory."""


@dataclass(frozen=True, slots=True)
class LoopSettings:
    """What the loop is told about every run of a batch: steps of h s, bound on |x_i|, sampling, output, thresholds.

    Raises ValueError, with the name and what was expected, for numbers that the loop cannot count or step with.
    """

    steps: int
    step: float
    bound: float = 1e6
    hold: int = 1
    output_every: int = 0
    response_band: float = 0.10
    settling_band: float = 0.05
    response_error: float = 0.0
    settling_error: float = 0.0
    start_time: float = 0.0

    def __post_init__(self) -> None:
        checked = {
            "steps": whole("steps", self.steps, 0, MOST_STEPS),
            "step": real("step", self.step, positive=True),
            "bound": real("bound", self.bound, positive=True, infinite=True),
            "hold": whole("hold", self.hold, 1, MOST_STEPS),
            "output_every": whole("output_every", self.output_every, 0, MOST_STEPS),
            "response_band": real("response_band", self.response_band),
            "settling_band": real("settling_band", self.settling_band),
            "response_error": real("response_error", self.response_error),
            "settling_error": real("settling_error", self.settling_error),
            "start_time": real("start_time", self.start_time),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)  # the numbers that were checked, whatever type they came in
        real("end, start_time + steps * step,", self.start_time + self.steps * self.step)

    @property
    def rows(self) -> int:
        """Trajectory rows of a complete run: k = 0, output_every, ..., and N."""
        if self.output_every == 0:
            return 0
        return self.steps // self.output_every + 1 + (self.steps % self.output_every != 0)


@dataclass(frozen=True, slots=True)
class Runs:
    """Results, one row a run.

    metrics      (runs, joints, len(METRICS)), NaN where there is none
    final_state  (runs, states), the last finite state, that of the controller behind the plant's;  end_time (runs,), s
    status       (runs,) index into STATUS
    quantity     (runs,) place in System.judged of what left its bound (`quantity_name`), or -1
    trajectory   (runs, rows, columns) or None;  rows (runs,) rows that were written
    """

    metrics: Floats
    final_state: Floats
    end_time: Floats
    status: NDArray[np.int32]
    quantity: NDArray[np.int32]
    trajectory: Floats | None = None
    rows: NDArray[np.int64] | None = None


def joined(parts: Sequence[Runs]) -> Runs:
    """The Runs of several calls as those of one, without trajectories."""
    names = ("metrics", "final_state", "end_time", "status", "quantity")
    return Runs(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


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
    "tables",
    "states",
    "metrics",
    "columns of a trajectory",
    "statuses",
)


@dataclass(frozen=True, slots=True)
class Shape:
    """What there is of everything that a loop takes and gives: all that a compiled one need know of its System.

    columns  of a trajectory;  tables: the signal tables that it reads
    """

    joints: int
    states: int
    columns: int
    tables: tuple[TableLayout, ...]

    @classmethod
    def of(cls, system: System) -> Shape:
        """The Shape of a System's loop."""
        return cls(system.n, system.x.numel() + system.z.numel(), len(system.trajectory), system.tables)


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
        tables: Sequence[Table] = (),
        *,
        watch: Watch | None = None,
    ) -> Runs:
        """Simulate one run per row of `parameters` (runs, len(self.parameters)), in this thread, without the GIL.

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
            hold=settings.hold,
            output_every=settings.output_every,
            response_band=settings.response_band,
            settling_band=settings.settling_band,
            response_error=settings.response_error,
            settling_error=settings.settling_error,
            parameters=parameters.ctypes.data,
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
        raise LayoutError(f"loop.c and kernel.py do not fit together ({'; '.join(wrong)}): install springline anew")
    return int(sizes[0])


def chatters(chatter: Floats, duration: Floats | float) -> NDArray[np.bool_]:
    """Which commands chatter: they go to and fro often in a second, and more than twice in the half that was looked at.

    chatter   the metric, 1/s;  duration  of the runs, s
    """
    return np.asarray((chatter > CHATTERING) & (chatter * (np.asarray(duration) / 2.0) > _SWINGS), dtype=np.bool_)


def quantity_name(system: System, quantity: int) -> str:
    """Name of what left its bound, "dq2_lift"; `quantity` as in Runs."""
    return system.judged[quantity].name


def compile_kernel(program: Program, spec: KernelSpec) -> Kernel:
    """Print and compile the Kernel of a Program; see `print_kernel`. Raises ToolchainError."""
    return Kernel(Shape.of(program.system), print_kernel(program, spec), spec.options.compiler)


@lru_cache(maxsize=64)
def kernel(spec: KernelSpec) -> Kernel:
    """The Kernel of a spec, compiled on first need and then remembered.

    Raises ToolchainError when there is no C compiler or it fails.
    """
    return compile_kernel(program(spec.structure), spec)
