"""The exported C library from Python through cffi: the very bits that the embedded controller computes.

Usage: control.py [EXPORT = ../../generated] [BUILD = build]; needs cffi and a C compiler.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from cffi import FFI


def declarations(header: str) -> str:
    """A header as cffi wants it: without preprocessor lines, the braces of extern "C", and const on objects."""
    lines = [line.replace("extern const", "extern") for line in header.splitlines() if not line.startswith("#")]
    return re.sub(r'extern "C" \{|^\}$', "", "\n".join(lines), flags=re.MULTILINE)


def build(export: Path, folder: Path) -> Path:
    """The shared library of an export."""
    folder.mkdir(parents=True, exist_ok=True)
    library = folder / "libspringline.so"
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared"]
    includes = [f"-I{export / 'include'}", f"-I{export / 'src'}"]
    command = [os.environ.get("CC", "cc"), *flags, *includes, str(export / "src" / "springline.c"), "-o", str(library)]
    subprocess.run(command, check=True)
    return library


def main(export: Path, folder: Path) -> None:
    """Close the loop for one second and print the tracking error."""
    ffi = FFI()
    ffi.cdef(declarations((export / "include" / "springline.h").read_text()))
    library = ffi.dlopen(str(build(export, folder)))

    def check(status: int) -> None:
        if status != library.SPRINGLINE_OK:
            raise RuntimeError(ffi.string(library.springline_status_text(status)).decode())

    controller, arm = ffi.new("springline_controller *"), ffi.new("springline_state *")
    reference, measurement = ffi.new("springline_reference *"), ffi.new("springline_measurement *")
    command, diagnostics = ffi.new("springline_command *"), ffi.new("springline_diagnostics *")
    base = ffi.new("springline_base[3]")
    check(library.springline_init(controller, ffi.addressof(library, "springline_default_config")))
    check(library.springline_start(controller, arm))
    measured = [name for name, _ in ffi.typeof("springline_measurement").fields]
    for k in range(1001):
        check(library.springline_signals(controller, 1e-3 * k, reference, base))
        for name in measured:
            setattr(measurement, name, getattr(arm, name))
        check(library.springline_step(controller, reference, measurement, command, diagnostics))
        if k % 200 == 0:
            print(f"t = {1e-3 * k:.1f} s: e = {diagnostics.e_lift:9.6f} m {diagnostics.e_rotation:9.6f} rad")
        for _ in range(10):
            check(library.springline_plant_step(controller, arm, command, ffi.NULL, 1e-4))

    measurement.q1_lift = float("nan")
    status = library.springline_step(controller, reference, measurement, command, ffi.NULL)
    print(f"a failed sensor: {ffi.string(library.springline_status_text(status)).decode()}; U = {command.U_lift} N")


if __name__ == "__main__":
    here = Path(__file__).resolve().parent
    given = [Path(argument) for argument in sys.argv[1:]]
    defaults = [here.parents[1] / "generated", here / "build"]
    main(*given, *defaults[len(given) :])
