"""Everything that `springline generate` writes: the C of one system, ready to be built elsewhere."""

from __future__ import annotations

from importlib import resources
from importlib.metadata import version
from typing import Any

from springline.codegen.elementary import float_header, math_header
from springline.codegen.export import Export, Port, check_linked, made_with, operations
from springline.codegen.export.c.interface import TypedInterface
from springline.codegen.export.c.model import model_files
from springline.codegen.export.c.texts import text_files
from springline.codegen.export.c.vectors import test_vectors


def generate_files(export: Export) -> tuple[dict[str, bytes], dict[str, Any]]:
    """The files of an export by relative path, and its manifest (to which codegen.manifest adds the list of files).

    The same export gives the same bytes in every process and folder.
    Raises ToolchainError without a C compiler, which the expected outputs of test_vectors.txt need; ValueError for a
    prefix that is too long for a linker and for numbers that export.real cannot hold, and Overflow, which is one, for
    those that the model cannot compute with.
    """
    check_linked(export.prefix)
    if export.real == "float":
        headers = {"sl_mathf.h": float_header().encode()}
    else:
        runtime = resources.files("springline.codegen") / "runtime"
        headers = {"sl_math.h": math_header().encode(), "sl_casadi.h": (runtime / "sl_casadi.h").read_bytes()}
    model = {**model_files(export), **{f"src/{name}": content for name, content in headers.items()}}
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
        "options": made_with(export),
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
