"""`springline export fmu2` and `fmu3`: a part of a system as a Co-Simulation FMU."""

from __future__ import annotations

import hashlib
import io
import platform
import sys
import uuid
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib import resources
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from springline.codegen.export import bind
from springline.codegen.export.c import TypedInterface
from springline.codegen.export.fmu.description import build_description, model_description
from springline.codegen.export.fmu.document import description, document
from springline.codegen.export.fmu.settings import FmiVersion, Settings
from springline.codegen.export.fmu.source import sources
from springline.codegen.export.fmu.variables import PARTS, Part, interface, part_parameters
from springline.codegen.kernel import toolchain
from springline.codegen.program import SignalTable
from springline.model.structure import SignalShape, Structure
from springline.model.system import system_of

__all__ = ["PARTS", "FmiVersion", "Part", "Settings", "fmu"]

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest date that a zip file knows: an FMU holds no other
_FLAGS = ("-fvisibility=hidden",)


def fmu(
    structure: Structure,
    values: NDArray[np.float64],
    settings: Settings,
    *,
    part: Part,
    version: FmiVersion,
    identifier: str,
    name: str,
    tables: Sequence[SignalTable] = (),
    tunable: Sequence[str] | Literal["all", "none"] = "all",
    timing: Sequence[str] = (),
) -> bytes:
    """The FMU file: description, C sources, binary for this machine, documentation and icon.

    structure   what the system consists of;  values: its numbers, one per System.slots entry, SI
    settings    times of the experiment, the integrator and the control
    part        "controller", "plant", or "loop": both of them with the reference
    version     of FMI: 2 or 3
    identifier  modelIdentifier: prefix of the C names and name of the binary
    name        modelName, for people
    tables      the data of the structure's table signals, in the order of System.tables
    tunable     parameters of the part that may be set: slot keys or what stands for several; the rest are constants
    timing      sentences on the sample periods and delays that the closed loop bears, for the page
    The same arguments give the same bytes on the same machine.
    The forces that disturb the links are inputs of plant and loop where the structure has none.
    Raises ValueError for a value out of its bounds, an unknown name or an unusable identifier; ToolchainError without
    a C compiler or for a machine whose name FMI does not know.
    """
    if part != "controller" and structure.disturbance.kind == "none":
        structure = replace(structure, disturbance=SignalShape("input"))
    system = system_of(structure)
    if (system.measured or system.commanded) and settings.period == 0.0:
        raise ValueError("sensors and motors go by samples: expected a period, 0 is for continuous control")
    if system.structure.differenced and settings.period == 0.0:
        raise ValueError("differenced rates go by samples: expected a period, 0 is for continuous control")
    if len(tables) != len(system.tables):
        raise ValueError(f"{len(tables)} tables given, the system has {len(system.tables)}")
    wanted = bind(structure, values, tunable=tunable).tunable
    keys = [system.slots[i].key for i in part_parameters(system, part) if i in set(wanted)]
    needed = () if part == "controller" else tables
    export = bind(
        structure,
        values,
        tunable=keys,
        prefix=identifier,
        tables=needed,
        period=settings.sample,
        seed=settings.seed,
        run=settings.run,
        timing=timing,
    )
    typed = TypedInterface(export, with_tip=part != "controller", with_judged=part == "loop")
    shown = interface(export, typed, part, sampled=part == "controller" or settings.period > 0.0)
    code = sources(export, typed, shown, settings, version)
    describe = partial(
        model_description, shown, settings, version, identifier=identifier, name=name, description=description(shown)
    )
    token = _token([*code.values(), describe(token="")])
    code["fmu_token.h"] = f'#define FMU_TOKEN "{token}"\n'.encode()
    binary = toolchain.build_library(code, main="all.c", flags=_FLAGS).read_bytes()
    page = document(export, shown, settings, version, name=name, identifier=identifier)
    icons = resources.files("springline.codegen") / "runtime" / "fmu"
    png, svg = (icons / "icon.png").read_bytes(), (icons / "icon.svg").read_bytes()
    licence = (icons / "licenses.txt").read_bytes()
    files = {
        "modelDescription.xml": describe(token=token),
        **{f"sources/{path}": content for path, content in code.items()},
        "sources/buildDescription.xml": build_description(identifier),
        f"binaries/{host_folder(version)}/{identifier}{library_suffix()}": binary,
        "documentation/index.html": page,
    }
    if version == 2:
        files |= {"model.png": png, "documentation/license.txt": licence}
    else:
        files |= {
            "terminalsAndIcons/icon.png": png,
            "terminalsAndIcons/icon.svg": svg,
            "documentation/licenses/license.txt": licence,
        }
    return _archive(files)


def host_folder(version: FmiVersion) -> str:
    """The folder below binaries/ for this machine. Raises ToolchainError where FMI has no name for it."""
    machine = platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    kernel = {"linux": "linux", "darwin": "darwin"}.get(sys.platform)
    two = {("linux", "x86_64"): "linux64", ("darwin", "x86_64"): "darwin64"}
    if kernel is None or (version == 2 and (kernel, machine) not in two):
        raise toolchain.ToolchainError(
            f"FMI {version} has no name for binaries of {sys.platform} on {machine}: use fmu3 or export elsewhere"
        )
    return two[kernel, machine] if version == 2 else f"{machine}-{kernel}"


def library_suffix() -> str:
    """How a shared library's name ends on this machine."""
    return ".dylib" if sys.platform == "darwin" else ".so"


def _token(contents: Iterable[bytes]) -> str:
    """A UUID that changes whenever the FMU may behave differently."""
    digest = hashlib.sha256(b"".join(hashlib.sha256(content).digest() for content in contents)).digest()
    return "{" + str(uuid.UUID(bytes=digest[:16])) + "}"


def _archive(files: Mapping[str, bytes]) -> bytes:
    """A zip of files by path, without anything of the machine or the day."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for path, content in sorted(files.items()):
            entry = zipfile.ZipInfo(path, _EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3  # unix: or the host's number would be written
            entry.external_attr = (0o755 if path.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, content, compresslevel=9)
    return stream.getvalue()
