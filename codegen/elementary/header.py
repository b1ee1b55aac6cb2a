"""sl_math.h and sl_mathf.h: the elementary functions as C, printed from their programs. templates/ has what is not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

from springline.codegen.elementary import arcs, circular, exponential, logarithm, power, printing
from springline.codegen.elementary.functions import procedure
from springline.codegen.elementary.primitives import Computed
from springline.codegen.elementary.words import DOUBLE, SINGLE, Format, Procedure, trace
from springline.codegen.files import render

_PARTS: dict[str, Callable[..., Computed]] = {
    "exp_parts": exponential.exp_parts,
    "log_denormal": logarithm.log_denormal,
    "sincos_reduced": circular.sincos_reduced,
    "tan_reduced": circular.tan_reduced,
    "angle": arcs.angle,
    "pow_general": power.pow_general,
    "pow_log": power.pow_log,
}
"""What only the headers need: pow without the rule for listed exponents, and what rare functions are made of."""


def _printers(fmt: Format) -> dict[str, Callable[..., str]]:
    def traced(name: str, inputs: int) -> Procedure:
        return trace(_PARTS[name], inputs, fmt) if name in _PARTS else procedure(name, fmt)

    def checked(name: str, *inputs: str, rare: str | None = None, results: Mapping[str, str] | None = None) -> str:
        """A function with its fast path; by default <name>_rare has the rest."""
        chosen = results or {"result": rare or f"{name}_rare"}
        return printing.checked(name, traced(name, len(inputs)), inputs, chosen)

    def plain(name: str, *inputs: str, as_name: str | None = None, results: Sequence[str] = ("result",)) -> str:
        """A function without anything rare, or whose rare cases do not come there."""
        return printing.plain(as_name or name, traced(name, len(inputs)), inputs, results)

    return {"checked": checked, "plain": plain, "part": plain}


@lru_cache(maxsize=1)
def math_header() -> str:
    """The text of sl_math.h."""
    return render("springline.codegen.elementary", "sl_math.h.j2", **_printers(DOUBLE))


@lru_cache(maxsize=1)
def float_header() -> str:
    """The text of sl_mathf.h."""
    return render("springline.codegen.elementary", "sl_mathf.h.j2", **_printers(SINGLE))
