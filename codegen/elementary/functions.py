"""The elementary functions by name: for each the common case, without branches, and where it holds.

What lies outside is a scalar function sl_<name>_rare in sl_math.h. Special values are those of C99 Annex F.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from springline.codegen.elementary import arcs, circular, exponential, logarithm, power, primitives, roots
from springline.codegen.elementary.primitives import Computed
from springline.codegen.elementary.words import DOUBLE, Format, Procedure, trace

FUNCTIONS: dict[str, tuple[Callable[..., Computed], int]] = {
    "fabs": (primitives.fabs, 1),
    "sq": (primitives.sq, 1),
    "copysign": (primitives.copysign, 2),
    "sign": (primitives.sign, 1),
    "floor": (primitives.floor, 1),
    "ceil": (primitives.ceil, 1),
    "hypot": (roots.hypot, 2),
    "exp": (exponential.exp, 1),
    "expm1": (exponential.expm1, 1),
    "cosh": (exponential.cosh, 1),
    "sinh": (exponential.sinh, 1),
    "tanh": (exponential.tanh, 1),
    "log": (logarithm.log, 1),
    "log1p": (logarithm.log1p, 1),
    "sincos": (circular.sincos, 1),
    "sin": (circular.sin, 1),
    "cos": (circular.cos, 1),
    "tan": (circular.tan, 1),
    "atan": (arcs.atan, 1),
    "atan2": (arcs.atan2, 2),
    "asin": (arcs.asin, 1),
    "acos": (arcs.acos, 1),
    "cbrt": (roots.cbrt, 1),
    "pow_p1_3": (roots.pow_p1_3, 1),
    "pow_m1_3": (roots.pow_m1_3, 1),
    "pow_p2_3": (roots.pow_p2_3, 1),
    "pow_m2_3": (roots.pow_m2_3, 1),
    "pow_p1_2": (roots.pow_p1_2, 1),
    "pow_m1_2": (roots.pow_m1_2, 1),
    "pow_p3_2": (roots.pow_p3_2, 1),
    "pow_p1": (roots.pow_p1, 1),
    "pow_m1": (roots.pow_m1, 1),
    "pow_p2": (roots.pow_p2, 1),
    "pow_p3": (roots.pow_p3, 1),
    "pow": (power.pow_, 2),
}
"""Name without prefix -> the function, and how many arguments it has."""


@cache
def procedure(name: str, fmt: Format = DOUBLE) -> Procedure:
    """The steps of an elementary function."""
    function, inputs = FUNCTIONS[name]
    return trace(function, inputs, fmt)
