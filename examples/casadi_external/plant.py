"""The exported C inside CasADi: load the compiled model with casadi.external, differentiate it, linearise the plant.

Usage: plant.py [EXPORT = ../../generated] [BUILD = build]; needs casadi and a C compiler.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np


def build(export: Path, folder: Path) -> Path:
    """The shared library of the model's functions."""
    folder.mkdir(parents=True, exist_ok=True)
    library = folder / "libspringline_model.so"
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", f"-I{export / 'src'}"]
    source = export / "src" / "springline_model.c"
    subprocess.run([os.environ.get("CC", "cc"), *flags, str(source), "-o", str(library)], check=True)
    return library


def main(export: Path, folder: Path) -> None:
    """Print the natural frequencies of the arm on its springs."""
    library = str(build(export, folder))
    gravity = ca.external("springline_gravity", library)
    mass_matrix = ca.external("springline_mass_matrix", library)
    plant = ca.external("springline_plant", library, {"enable_fd": True})  # C has no derivatives: finite differences
    print(plant)

    rest, q1 = np.zeros(3), np.array([0.8, 0.5])
    weight = np.array(gravity(q1)).ravel()
    manifest = json.loads((export / "manifest.json").read_text())
    stiffness = np.array([item["value"] for item in manifest["parameters"] if item["name"].startswith("plant.k_s")])
    x = np.concatenate([q1, np.zeros(2), q1 + weight / stiffness, np.zeros(2)])
    print("M1 =", np.array(mass_matrix(q1)).tolist())
    print("largest acceleration at rest:", float(np.abs(np.array(plant(rest, rest, rest, x, weight))).max()))

    state = ca.MX.sym("x", 8)
    slope = plant(rest, rest, rest, state, weight)
    linear = np.array(ca.Function("A", [state], [ca.jacobian(slope, state)])(x))
    frequencies = sorted(
        {round(float(abs(value.imag)), 1) for value in np.linalg.eigvals(linear) if abs(value.imag) > 1}
    )
    print("natural frequencies, rad/s:", frequencies)


if __name__ == "__main__":
    here = Path(__file__).resolve().parent
    given = [Path(argument) for argument in sys.argv[1:]]
    defaults = [here.parents[1] / "generated", here / "build"]
    main(*given, *defaults[len(given) :])
