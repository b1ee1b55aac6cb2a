"""SI units as FMI wants them: a name and the exponents of the base units."""

from __future__ import annotations

import re
from collections import Counter

_DERIVED = {
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
}


def base_exponents(unit: str) -> dict[str, int] | None:
    """Exponents of kg, m, s, rad of a unit as the model writes it ("N m/rad", "1/s", "kg m^2"); {} for "1".

    What stands behind a slash is divided by. None for a unit that is no product of powers of these ("m or rad", "SI").
    """
    exponents: Counter[str] = Counter()
    for part, sign in zip(unit.split("/"), (1, *[-1] * unit.count("/")), strict=True):
        for factor in part.split():
            found = re.fullmatch(r"([A-Za-z]+)(?:\^(\d+))?", factor)
            if factor == "1":
                continue
            if found is None or found[1] not in _DERIVED:
                return None
            for base, exponent in _DERIVED[found[1]].items():
                exponents[base] += sign * exponent * int(found[2] or 1)
    return {base: exponents[base] for base in ("kg", "m", "s", "rad") if exponents[base]}
