"""test_vectors.txt: inputs and the outputs that every build of an export must give, to the last bit.

The outputs come from the model's functions, compiled here, and a Runge-Kutta step in NumPy, so the typed interface that
replays them is checked against code that is not its own.
"""

from __future__ import annotations

import ctypes
import math
import operator
import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
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
        library = toolchain.build_library(flat, main=f"{export.prefix}_model.c", flags=("-O1",))
        self._handle = toolchain.load(library)
        self._export = export
        self.dtype = np.float64 if export.real == "double" else np.float32
        self._p = np.array([export.values[i] for i in export.tunable], self.dtype)

    def __call__(self, name: str, *inputs: Numbers) -> list[Numbers]:
        """The outputs of function `name` with the exported parameters."""
        function = self._export.system.function(name)
        arrays = [np.ascontiguousarray(x, self.dtype) for x in inputs] + ([self._p] if len(self._p) else [])
        results = [np.zeros(function.numel_out(i), self.dtype) for i in range(function.n_out())]
        arguments, outputs = (
            (ctypes.c_void_p * len(part))(*(x.ctypes.data for x in part)) for part in (arrays, results)
        )
        self._handle[f"{self._export.prefix}_{name}"](arguments, outputs, None, None, 0)
        return results


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
        rows = [f"control {_hex(row)}" for row in control]
        rows += [f"plant {_hex(row)}" for row in _finite(export, names["state"].split(), _plant_rows(interface, model))]
    return "".join([*(f"# {line}\n" for line in lines), *(f"{row}\n" for row in rows)]).encode()


def control_outputs(export: Export) -> list[str]:
    """What a control vector's outputs are called, in order.

    Those of the model's control, then the flags of limits, and last the controller's states after the sample.
    """
    system = export.system
    limits = (SATURATED, A_LIMITED) if system.controller.law else (SATURATED,)
    quantities = (U, *system.command_parts, E, *system.sliding, *limits, *system.controller_states)
    return [entry.name for entry in entries(quantities, system.joints)]


def _finite(export: Export, outputs: Sequence[str], rows: Iterable[list[float]]) -> Iterator[list[float]]:
    """The rows, which end with `outputs`. Raises Overflow if one of these is not finite."""
    for row in rows:
        for name, value in zip(outputs, row[-len(outputs) :], strict=True):
            if not math.isfinite(value):
                raise Overflow(export, name)
        yield row


def _hex(numbers: Sequence[float]) -> str:
    """Hexadecimal floats without the zeros at their end."""
    words = []
    for number in numbers:
        significand, exponent = float(number).hex().split("p")
        words.append(f"{significand.rstrip('0').rstrip('.') if '.' in significand else significand}p{exponent}")
    return " ".join(words)


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


def _control_rows(interface: TypedInterface, model: _Model) -> Iterator[list[float]]:
    system = interface.export.system
    n, draw = system.n, _Draw()
    z = np.array(system.z_start, model.dtype)  # the vectors are a sequence: what a sample leaves, the next one takes
    names = {field.name for field in interface.structures["measurement"]}
    measured = [k for k, field in enumerate(interface.structures["state"]) if field.name in names]
    for _ in range(CONTROL_VECTORS):
        q1d, dq1d, ddq1d = draw.uniform(2.0, n), draw.uniform(4.0, n), draw.uniform(8.0, n)
        error, rate = draw.small(1, n), draw.small(2, n)
        q1 = [a - b for a, b in zip(q1d, error, strict=True)]
        dq1 = [a - b for a, b in zip(dq1d, rate, strict=True)]
        dq2 = [a + b for a, b in zip(dq1, draw.small(0, n), strict=True)]
        reference = np.array([*q1d, *dq1d, *ddq1d], model.dtype)
        x = np.array([*q1, *dq1, *q1, *dq2][: system.x.numel()], model.dtype)
        seen, before = [*np.split(reference, 3), x, *([z] if len(z) else [])], z
        outputs = model("control", *seen)
        flags = _limits_met(interface.export, model, outputs)
        if len(z):
            [z] = model("update", *seen, np.array([interface.export.period], model.dtype))
        yield [*reference, *x[measured], *before, *(value for part in outputs for value in part), *flags, *z]


def _limits_met(export: Export, model: _Model, outputs: Sequence[Numbers]) -> Iterator[float]:
    """Per joint whether U_max has limited the command (0 or 1), then whether a_max has limited a reaching law.

    outputs  of the model's control: the command, the parts it is the sum of, error, sliding variable
    """
    u, *parts = outputs[: 1 + len(export.system.command_parts)]
    yield from (u != reduce(operator.add, parts)).astype(float)
    law = export.system.controller.law
    if law is None:
        return
    for i, value in enumerate(outputs[-1]):
        [wished] = model(f"law_{law.name}", np.array([value], model.dtype))
        yield float(abs(wished[0]) > model.dtype(export.value(f"control.a_max.{i}")))


def _plant_rows(interface: TypedInterface, model: _Model) -> Iterator[list[float]]:
    system, draw = interface.export.system, _Draw()
    n, coordinates = system.n, system.base.b.numel()
    for _ in range(PLANT_VECTORS):
        motion = [np.array(draw.uniform(bound, coordinates), model.dtype) for bound in (0.5, 1.0, 2.0)]
        q1 = draw.uniform(2.0, n)
        stretch = [value / 1024 for value in draw.uniform(4.0, n)]
        x = np.array(
            [*q1, *draw.uniform(4.0, n), *(a + b for a, b in zip(q1, stretch, strict=True)), *draw.uniform(4.0, n)][
                : system.x.numel()
            ],
            model.dtype,
        )
        u = np.array(draw.uniform(2048.0, n), model.dtype)
        motion += [np.array(draw.uniform(256.0, n), model.dtype)] if system.forces else []
        yield [*np.concatenate(motion), *x, *u, *_runge_kutta(system.tableau, model, motion, x, u)]


def _runge_kutta(tableau: Tableau, model: _Model, motion: Sequence[Numbers], x: Numbers, u: Numbers) -> Numbers:
    """One step, operation by operation as the C does it; `motion` of the base, and forces behind it."""
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
