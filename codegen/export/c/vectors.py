"""test_vectors.txt: inputs and the outputs that every build of an export must give, to the last bit.

The outputs come from the model's functions, compiled here, and a Runge-Kutta step in NumPy, so the typed interface that
replays them is checked against code that is not its own.
"""

from __future__ import annotations

import ctypes
import math
import operator
import random
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springline.codegen.export import Export, provenance
from springline.codegen.export.c.interface import TypedInterface
from springline.codegen.kernel import toolchain
from springline.codegen.program import updates
from springline.model.integrators import Tableau
from springline.model.quantities import A_LIMITED, SATURATED, E, U, entries

CONTROL_VECTORS = 1000
PLANT_VECTORS = 200
TIME_STEP = 1e-4
"""Step of the plant vectors, s."""

Numbers = NDArray[Any]  # float64 or float32

_LAST_ZEROS = re.compile(r"\.?0*p")


class Overflow(ValueError):
    """With an export's numbers the model leaves the finite numbers, and no test vector can be.

    key, value  the parameter that is farthest from 1, by orders of magnitude: the likely cause
    """

    def __init__(self, export: Export, what: str) -> None:
        known = [(slot.key, value) for slot, value in zip(export.slots, export.values, strict=True)]
        finite = [(key, value) for key, value in known if value != 0.0 and math.isfinite(value)]
        self.key, self.value = max(finite, key=lambda item: abs(math.log10(abs(item[1]))))
        super().__init__(
            f"{what} is not a finite {export.real} at an ordinary state: expected parameters that the model can "
            "compute with, and this is the one farthest from 1"
        )


class _Model:
    """The compiled functions of the model."""

    def __init__(self, export: Export, sources: Mapping[str, bytes]) -> None:
        flat = {PurePosixPath(path).name: content for path, content in sources.items()}
        # Bits do not depend on the level, and the compiler takes a third of the time that it takes with -O1.
        library = toolchain.build_library(flat, main=f"{export.prefix}_model.c", flags=("-O0",))
        self._handle = toolchain.load(library)
        self._export = export
        self.dtype = np.float64 if export.real == "double" else np.float32
        self._p = np.array([export.values[i] for i in export.tunable], self.dtype)

    def __call__(self, name: str, *inputs: Numbers, into: Sequence[Numbers] | None = None) -> list[Numbers]:
        """The outputs of function `name` with the exported parameters, row by row.

        inputs  a row of numbers per call, or one row for all
        into    where the outputs go, if not into new matrices: inputs of later rows may be among them
        """
        function = self._export.system.function(name)
        arrays = [np.ascontiguousarray(np.atleast_2d(x), self.dtype) for x in inputs]
        arrays += [self._p[None]] if len(self._p) else []
        rows = max(len(array) for array in arrays)
        if into is None:
            into = [np.zeros((rows, function.numel_out(i)), self.dtype) for i in range(function.n_out())]
        places, results = (
            [(array.ctypes.data, array.strides[0] if len(array) > 1 else 0) for array in part]
            for part in (arrays, into)
        )
        call = self._handle[f"{self._export.prefix}_{name}"]
        arguments, outputs = ((ctypes.c_void_p * len(part))() for part in (places, results))
        for row in range(rows):
            arguments[:] = [start + row * stride for start, stride in places]
            outputs[:] = [start + row * stride for start, stride in results]
            call(arguments, outputs, None, None, 0)
        return list(into)


def test_vectors(export: Export, interface: TypedInterface, sources: Mapping[str, bytes]) -> bytes:
    """The file. sources: the model's C files and what they include, by path. Raises ToolchainError, Overflow."""
    model = _Model(export, sources)
    names = {name: " ".join(field.name for field in fields) for name, fields in interface.structures.items()}
    lines = [
        *provenance(export),
        f"control: {names['reference']} {names['measurement']}" + (f" {names['memory']}" if "memory" in names else ""),
        f"      -> {' '.join(control_outputs(export))}",
        f"plant (a step of {TIME_STEP!r} s, base motion constant): {names['base']} {names['state']} {names['command']}",
        f"      -> {names['state']}",
    ]
    with np.errstate(all="ignore"):  # Overflow says more
        control = _finite(export, control_outputs(export), _control_rows(interface, model))
        plant = _finite(export, names["state"].split(), _plant_rows(interface, model))
    rows = [f"{kind} {_hex(row)}" for kind, part in (("control", control), ("plant", plant)) for row in part.tolist()]
    return "".join([*(f"# {line}\n" for line in lines), *(f"{row}\n" for row in rows)]).encode()


def control_outputs(export: Export) -> list[str]:
    """What a control vector's outputs are called, in order.

    Those of the model's control, then the flags of limits, and last the controller's states after the sample.
    """
    system = export.system
    limits = (SATURATED, A_LIMITED) if system.controller.law else (SATURATED,)
    quantities = (U, *system.command_parts, E, *system.sliding, *limits, *system.controller_states)
    return [entry.name for entry in entries(quantities, system.joints)]


def _finite(export: Export, outputs: Sequence[str], rows: Numbers) -> Numbers:
    """The rows, which end with `outputs`. Raises Overflow for the first of these that is not finite."""
    wrong = np.argwhere(~np.isfinite(rows[:, -len(outputs) :]))
    if len(wrong):
        raise Overflow(export, outputs[wrong[0][1]])
    return rows


def _hex(numbers: Sequence[float]) -> str:
    """Hexadecimal floats without the zeros at their end."""
    return _LAST_ZEROS.sub("p", " ".join(map(float.hex, numbers)))


class _Draw:
    """Short pseudo-random numbers, the same everywhere."""

    def __init__(self) -> None:
        self._random = random.Random(474)  # noqa: S311 - no secret

    def uniform(self, bound: float, count: int) -> list[float]:
        """In steps of bound/1024 between -bound and bound."""
        return [bound * self._random.randint(-1024, 1024) / 1024 for _ in range(count)]

    def small(self, largest: int, count: int) -> list[float]:
        """Of all sizes from 2^(largest-20) to 2^largest, one in ten zero."""
        return [
            0.0
            if self._random.random() < 0.1
            else self._random.choice((-1, 1)) * 2.0 ** self._random.randint(largest - 20, largest)
            for _ in range(count)
        ]


def _control_rows(interface: TypedInterface, model: _Model) -> Numbers:
    system = interface.export.system
    n, draw = system.n, _Draw()
    drawn = np.array([
        [
            *draw.uniform(2.0, n), *draw.uniform(4.0, n), *draw.uniform(8.0, n),
            *draw.small(1, n), *draw.small(2, n), *draw.small(0, n),
        ]
        for _ in range(CONTROL_VECTORS)
    ])  # fmt: skip
    q1d, dq1d, _, error, rate, stretching = np.split(drawn, 6, axis=1)
    q1, dq1 = q1d - error, dq1d - rate
    reference = drawn[:, : 3 * n].astype(model.dtype)
    base = _measured_base(interface, draw).astype(model.dtype)
    x = np.hstack([q1, dq1, q1, dq1 + stretching]).astype(model.dtype)[:, : system.x.numel()]
    # The vectors are a sequence: what a sample leaves in z, the next one takes.
    z = np.tile(np.array(system.z_start, model.dtype), (CONTROL_VECTORS + 1, 1))
    before, after = z[:-1], z[1:]
    fed = np.split(base, 3, axis=1) if base.size else []
    seen = [*np.split(reference, 3, axis=1), *fed, x, *([before] if system.memory else [])]
    period = [np.array([interface.export.period])]
    if system.memory:
        model("update", *seen, *period, into=[after])
    outputs = model("control", *seen, *(period if system.structure.differenced else []))
    names = {field.name for field in interface.structures["measurement"]}
    measured = [k for k, field in enumerate(interface.structures["state"]) if field.name in names]
    flags = _limits_met(interface.export, model, outputs)
    return np.hstack([reference, base, x[:, measured], before, *outputs, *flags, after])


def _measured_base(interface: TypedInterface, draw: _Draw) -> Numbers:
    """The base's motion that a controller is told of, a row per vector; no column where it is told of none."""
    size = len(interface.measured_base) // 3
    rows = (
        [*draw.uniform(0.5, size), *draw.uniform(1.0, size), *draw.uniform(2.0, size)] for _ in range(CONTROL_VECTORS)
    )
    return np.array(list(rows)).reshape(CONTROL_VECTORS, 3 * size)


def _limits_met(export: Export, model: _Model, outputs: Sequence[Numbers]) -> Iterator[Numbers]:
    """Whether U_max has limited the command (0 or 1), then whether a_max has limited a reaching law, by row and joint.

    outputs  of the model's control: the command, the parts it is the sum of, error, sliding variable
    """
    u, *parts = outputs[: 1 + len(export.system.command_parts)]
    yield (u != reduce(operator.add, parts)).astype(model.dtype)
    law = export.system.controller.law
    if law is None:
        return
    sigma = outputs[-1]
    [wished] = model(f"law_{law.name}", sigma.reshape(-1, 1))
    limits = [model.dtype(export.value(f"control.a_max.{i}")) for i in range(export.system.n)]
    yield (np.abs(wished.reshape(sigma.shape)) > limits).astype(model.dtype)


def _plant_rows(interface: TypedInterface, model: _Model) -> Numbers:
    system, draw = interface.export.system, _Draw()
    n, coordinates = system.n, system.base.b.numel()
    bounds = [(0.5, coordinates), (1.0, coordinates), (2.0, coordinates)]
    bounds += [(2.0, n), (4.0, n), (4.0, n), (4.0, n), (2048.0, n), *([(256.0, n)] if system.forces else [])]
    drawn = np.array([[k for bound in bounds for k in draw.uniform(*bound)] for _ in range(PLANT_VECTORS)])
    b, db, ddb, q1, stretch, dq1, dq2, u, *forces = np.split(drawn, np.cumsum([count for _, count in bounds])[:-1], 1)
    x = np.hstack([q1, dq1, q1 + stretch / 1024, dq2])[:, : system.x.numel()]
    motion = [part.astype(model.dtype) for part in (b, db, ddb, *forces)]
    x, u = x.astype(model.dtype), u.astype(model.dtype)
    return np.hstack([*motion, x, u, _runge_kutta(system.tableau, model, motion, x, u)])


def _runge_kutta(tableau: Tableau, model: _Model, motion: Sequence[Numbers], x: Numbers, u: Numbers) -> Numbers:
    """One step a row, operation by operation as the C does it; `motion` of the base, and forces behind it."""
    real = model.dtype
    h = real(TIME_STEP)
    slopes: list[Numbers] = []
    at = after = x
    for update in updates(tableau):
        slopes += model("plant", *motion, at, u)
        if update.next:
            after = after + (real(update.next) * h) * slopes[-1]
        at = x
        for factor, stage in update.at:
            at = at + (real(factor) * h) * slopes[stage]
    return after
