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
from springline.codegen.doubles import doubles
from springline.codegen.kernel_source import ONE_RUN, Engine, KernelOptions, KernelSource, print_kernel
from springline.codegen.program import Program, program
from springline.model.system import Structure, TableLayout

__all__ = [
    "METRICS",
    "ONE_RUN",
    "STATUS",
    "Control",
    "Engine",
    "Kernel",
    "KernelOptions",
    "LoopSettings",
    "Runs",
    "Table",
    "compile_kernel",
    "joined",
    "kernel",
]

Floats = NDArray[np.float64]

METRICS = (
    "response_time",
    "settling_time",
    "overshoot",
    "steady_state_error",
    "iae",
    "U_max",
    "U_tv",
    "sigma_tv",
    "dq1_tv",
)
"""Per joint, in the order of metrics.h."""

STATUS = ("ok", "diverged", "out_of_bounds", "stopped")
"""In the order of simulate.h."""


@dataclass(frozen=True, slots=True)
class Table:
    """Knots of one table signal: interval k starts at t0 + k dt; coefficients (intervals, channels, 4), tau in s."""

    t0: float
    dt: float
    periodic: bool
    coefficients: Floats


@dataclass(frozen=True, slots=True)
class LoopSettings:
    """What the loop is told about every run of a batch: steps of h s, bound on |x_i|, sampling, output, thresholds."""

    steps: int
    step: float
    bound: float = 1e6
    hold: int = 1
    output_every: int = 0
    response_band: float = 0.10
    settling_band: float = 0.05
    start_time: float = 0.0

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
    final_state  (runs, 4n), the last finite state;  end_time (runs,), s
    status       (runs,) index into STATUS;  quantity (runs,) state entry that left its bound, or -1
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
class Control:
    """Shared with a running call from another thread: `progress` counts steps x runs, setting `stop` ends it early."""

    progress: ctypes.c_int64 = field(default_factory=ctypes.c_int64)
    stop: ctypes.c_int32 = field(default_factory=ctypes.c_int32)


class _Table(ctypes.Structure):
    _fields_ = [
        ("t0", ctypes.c_double),
        ("dt", ctypes.c_double),
        ("intervals", ctypes.c_int64),
        ("channels", ctypes.c_int64),
        ("periodic", ctypes.c_int64),
        ("coefficients", ctypes.c_void_p),
    ]


class _Job(ctypes.Structure):
    _fields_ = [
        ("first", ctypes.c_int64),
        ("last", ctypes.c_int64),
        ("steps", ctypes.c_int64),
        ("start_time", ctypes.c_double),
        ("step", ctypes.c_double),
        ("bound", ctypes.c_double),
        ("hold", ctypes.c_int64),
        ("output_every", ctypes.c_int64),
        ("response_band", ctypes.c_double),
        ("settling_band", ctypes.c_double),
        ("parameters", ctypes.c_void_p),
        ("tables", ctypes.c_void_p),
        ("metrics", ctypes.c_void_p),
        ("final_state", ctypes.c_void_p),
        ("end_time", ctypes.c_void_p),
        ("status", ctypes.c_void_p),
        ("quantity", ctypes.c_void_p),
        ("trajectory", ctypes.c_void_p),
        ("rows", ctypes.c_void_p),
        ("capacity", ctypes.c_int64),
        ("progress", ctypes.c_void_p),
        ("stop", ctypes.c_void_p),
    ]


class Kernel:
    """The compiled loop of one Program.

    program     what it was printed from
    parameters  slot keys in the order of the columns that `run` takes
    width       runs that are simulated together (lanes x groups x packs)
    library     the shared library, in the cache
    """

    def __init__(self, program: Program, source: KernelSource, compiler: toolchain.Compiler | None = None) -> None:
        self.program = program
        self.parameters = source.parameters
        self.library = toolchain.build_library(dict(source.files), main="loop.c", flags=source.flags, compiler=compiler)
        handle = toolchain.load(self.library)
        self._simulate: Any = handle.springline_simulate
        self._simulate.restype = None
        layout = (ctypes.c_int64 * 6)()
        handle.springline_layout(layout)
        self.width, parameters, self._states, self._metrics, self._columns, tables = layout
        assert parameters == len(self.parameters) and tables == len(self.program.system.tables)

    def run(
        self,
        parameters: Floats,
        settings: LoopSettings,
        tables: Sequence[Table] = (),
        *,
        control: Control | None = None,
    ) -> Runs:
        """Simulate one run per row of `parameters` (runs, len(self.parameters)), in this thread, without the GIL.

        Raises ValueError if `parameters` or `tables` do not have the shape the kernel was built for, TypeError or
        ValueError for numbers that are no doubles.
        """
        parameters = doubles(parameters)
        runs = len(parameters) if parameters.ndim else 0
        if parameters.shape != (runs, len(self.parameters)):
            raise ValueError(f"parameters have shape {parameters.shape}, expected (runs, {len(self.parameters)})")
        layouts: Sequence[TableLayout] = self.program.system.tables
        if len(tables) != len(layouts):
            raise ValueError(f"{len(tables)} tables given, the system has {len(layouts)}")
        c_tables = (_Table * max(len(tables), 1))()
        coefficients = [doubles(table.coefficients) for table in tables]
        for i, (table, layout, data) in enumerate(zip(tables, layouts, coefficients, strict=True)):
            if data.ndim != 3 or data.shape[1:] != (len(layout.channels), 4):
                raise ValueError(
                    f"table {layout.signal}: coefficients have shape {data.shape}, "
                    f"expected (intervals, {len(layout.channels)}, 4)"
                )
            c_tables[i] = _Table(
                table.t0, table.dt, data.shape[0], data.shape[1], int(table.periodic), data.ctypes.data
            )
        rows = settings.rows
        result = Runs(
            metrics=np.full((runs, self.program.system.n, len(METRICS)), np.nan),
            final_state=np.zeros((runs, self._states)),
            end_time=np.zeros(runs),
            status=np.zeros(runs, np.int32),
            quantity=np.full(runs, -1, np.int32),
            trajectory=np.full((runs, rows, self._columns), np.nan) if rows else None,
            rows=np.zeros(runs, np.int64) if rows else None,
        )
        job = _Job(
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
            progress=ctypes.addressof(control.progress) if control else None,
            stop=ctypes.addressof(control.stop) if control else None,
        )
        self._simulate(ctypes.byref(job))
        return result


def compile_kernel(
    program: Program, sampled: bool = False, options: KernelOptions | None = None, baked: tuple[float, ...] = ()
) -> Kernel:
    """Print and compile the Kernel of a Program; see `print_kernel`. Raises ToolchainError."""
    options = options or KernelOptions()
    return Kernel(program, print_kernel(program, sampled, options, baked), options.compiler)


@lru_cache(maxsize=64)
def kernel(
    structure: Structure, sampled: bool = False, options: KernelOptions | None = None, baked: tuple[float, ...] = ()
) -> Kernel:
    """The Kernel of a structure, compiled on first need and then remembered.

    baked  values of all slots, in their order, for a kernel with baked parameters; () when every slot is tunable
    Raises ToolchainError when there is no C compiler or it fails.
    """
    return compile_kernel(program(structure), sampled, options, baked)
