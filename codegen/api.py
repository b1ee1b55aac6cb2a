"""Everything that `springline generate` writes: the C of one system, ready to be built elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from importlib.metadata import version
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from springline.codegen.export import Export, Port, Real, bind, operations
from springline.codegen.export_text import text_files
from springline.codegen.model_c import model_files
from springline.codegen.typed import TypedInterface
from springline.codegen.vectors import test_vectors
from springline.model.system import Structure


def generate_files(
    structure: Structure,
    values: NDArray[np.float64],
    *,
    tunable: Sequence[str] | Literal["all", "none"] = "none",
    prefix: str = "springline",
    real: Real = "double",
) -> tuple[dict[str, bytes], dict[str, Any]]:
    """The files of an export by relative path, and its manifest (to which codegen.manifest adds the list of files).

    structure  what the system consists of
    values     its numbers, one per System.slots entry, SI
    tunable    parameters that stay variables of the C: slot keys, or what stands for several ("control", "control.mu")
    prefix     of every public name
    real       number type of the C
    The same arguments give the same bytes in every process and folder.
    Raises ValueError for a value out of its bounds, an unknown name or an unusable prefix; ToolchainError without a C
    compiler, which the expected outputs of test_vectors.txt need.
    """
    export = bind(structure, values, tunable=tunable, prefix=prefix, real=real)
    runtime = resources.files("springline.codegen") / "runtime"
    headers = ("sl_mathf.h",) if real == "float" else ("sl_math.h", "sl_casadi.h")
    model = {**model_files(export), **{f"src/{name}": (runtime / name).read_bytes() for name in headers}}
    interface = TypedInterface(export)
    files = {
        **model,
        **text_files(export, interface),
        "test_vectors.txt": test_vectors(export, interface, model),
    }
    return files, manifest(export)


def manifest(export: Export) -> dict[str, Any]:
    """What manifest.json says beside its list of files."""

    def describe(port: Port) -> dict[str, Any]:
        return {"name": port.name, "shape": list(port.shape), "unit": list(port.units)}

    counts = operations(export)
    return {
        "springline": version("springline"),
        "casadi": version("casadi"),
        "hash": export.sha256,
        "parameters": [
            {
                "name": slot.key,
                "value": value,
                "unit": slot.unit,
                "binding": "run" if i in set(export.tunable) else "baked",
            }
            for i, (slot, value) in enumerate(zip(export.slots, export.values, strict=True))
        ],
        "functions": [
            {
                "name": name,
                "inputs": [describe(port) for port in export.inputs(function)],
                "outputs": [describe(port) for port in export.outputs(function)],
                "operations": counts[name],
            }
            for name, function in export.model_functions()
        ],
    }
