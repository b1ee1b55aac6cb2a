"""Whether masses and inertias are those of a body that can exist."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from springline.model.mechanisms.mechanism import Mechanism
from springline.model.parameters import Values

# Relative to the largest principal moment: an inertia that was written in rounded digits is not refused for them.
_ROUNDED = 1e-6


def expect_plausible(mechanism: Mechanism, p: Values, symbols: ca.SX, q: Sequence[float], values: np.ndarray) -> None:
    """Raise ValueError, with body and numbers, for a mass or an inertia that no body has.

    symbols, values  what the entries of p are made of, and their numbers
    q                joint coordinates, n x 1: the inertia of a body may depend on them
    A scalar inertia, about z alone, is of an arm in a plane: it only must not be negative.
    """
    at = ca.SX.sym("q", len(mechanism.joints))
    owner = f"mechanism {mechanism.name}"
    if mechanism.said_as == "links":
        told = [(f"link {s.name!r}", s.mass, s.inertia, s.planar) for s in mechanism.segments(p)]
    elif mechanism.said_as == "bodies":
        bodies = enumerate(mechanism.checked_bodies(at, p))
        told = [(f"bodies[{i}]", body.mass, body.inertia, body.planar) for i, body in bodies]
    else:
        return
    outputs = [item for _, mass, inertia, _ in told for item in (mass, ca.densify(inertia))]
    numbers = iter(ca.Function("bodies", [at, symbols], outputs).call([ca.DM(list(q)), ca.DM(values)]))
    for (name, _, _, planar), mass, inertia in zip(told, numbers, numbers, strict=False):
        _expect(f"{owner}: {name}", float(mass), np.array(inertia), planar)


def _expect(owner: str, mass: float, inertia: np.ndarray, planar: bool) -> None:
    if not mass >= 0.0:
        raise ValueError(f"{owner}: mass: expected a number >= 0, got {mass:g}")
    if planar:
        if not inertia[2, 2] >= 0.0:
            raise ValueError(f"{owner}: inertia: expected a number >= 0, got {inertia[2, 2]:g}")
        return
    scale = float(np.abs(inertia).max())
    if not np.isfinite(scale) or np.abs(inertia - inertia.T).max() > _ROUNDED * scale:
        raise ValueError(f"{owner}: inertia: expected a symmetric matrix of finite numbers, got {inertia.tolist()}")
    moments = np.linalg.eigvalsh(inertia)
    shown = ", ".join(f"{value:g}" for value in moments)
    if moments[0] < -_ROUNDED * scale:
        raise ValueError(f"{owner}: inertia: expected principal moments >= 0, got {shown}")
    if moments[2] > (1 + _ROUNDED) * (moments[0] + moments[1]):
        text = "no body has a principal moment above the sum of the other two (an arm in a plane takes a scalar)"
        raise ValueError(f"{owner}: inertia: {text}, got {shown}")
