"""Generated text: what a template may not do, how its filters lay out, and how long a line of generated C gets."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import jinja2
import pytest

import springline.codegen.export.c
from springline.codegen.export.bound import bind
from springline.codegen.export.c.tree import generate_files
from springline.codegen.export.names import check_prefix
from springline.codegen.files.templates import LINE, aligned, comment, fitted, quoted, render, wrap
from springline.runner import load_scenario

LONGEST = "manipulator_on_a_ship_number_7"
OTHERS = ("_model.c", "_model.h", "sl_math.h", "sl_mathf.h", "sl_casadi.h", "sl_tables.h")
"""Not printed from templates."""

INTEGRAL = """
from springline.model import Control, Controller, Parameter, Quantity

class Integral(Controller):
    '''Computed torque with an integral.'''
    parameters = (Parameter("w", "1/s", 12.0, "bandwidth", per_joint=True),)
    states = (Quantity("xi", "xi", "{q} s", "integral of error"),)

    def control(self, r, y, z, model, p):
        arm, e = model(y.q1, y.dq1), r.q - y.q1
        u = arm.H @ (r.ddq + 3 * p.w * (r.dq - y.dq1) + 3 * p.w**2 * e + p.w**3 * z.xi)
        return Control(u + arm.c + arm.G, e, {"xi": e})
"""


def exported(prefix: str, case: str, folder: Path, **options: Any) -> dict[str, str]:
    """The files of an export, without the test vectors."""
    (folder / "integral.py").write_text(INTEGRAL)
    scenario = {
        "plain": lambda: load_scenario("paper/nominal"),
        "tables": lambda: load_scenario("ship/vessel_10hz"),
        "memory": lambda: load_scenario("paper/nominal", {"control.controller": f"{folder}/integral.py:Integral"}),
    }[case]()
    if case == "tables":
        options["tables"] = scenario.tables()
    files, _ = generate_files(bind(scenario.structure(), scenario.values(), prefix=prefix, **options))
    return {path: text.decode() for path, text in files.items() if path != "test_vectors.txt"}
