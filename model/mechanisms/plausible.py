"""Whether masses and inertias are those of a body that can exist, in one run or in many."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from springline.model import lazy_casadi as ca
from springline.model.mechanisms.mechanism import Mechanism
from springline.model.parameters import Values
from springline.model.symbolic import over_runs

Floats = NDArray[np.float64]

# Relative to the largest principal moment: an inertia that was written in rounded digits is not refused for them.
_ROUNDED = 1e-6


class Implausible(ValueError):
    """Numbers that no arm has.

    run  the first of the runs that have them, from 0: the message is about it
    """

    def __init__(self, text: str, run: int) -> None:
        super().__init__(text)
        self.run = run


class BodyCheck:
    """What the links or bodies of a mechanism weigh, as numbers; nothing where the mechanism says energies.

    p, symbols  the mechanism's parameters, and what their entries are made of
    A scalar inertia, about z alone, is of an arm in a plane: it only must not be negative.
    """

    def __init__(self, mechanism: Mechanism, p: Values, symbols: ca.SX) -> None:
        at = ca.SX.sym("q", len(mechanism.joints))
        owner = f"mechanism {mechanism.name}"
        told = []
        if mechanism.said_as == "links":
            told = [(f"link {s.name!r}", s.mass, s.inertia, s.planar) for s in mechanism.segments(p)]
        elif mechanism.said_as == "bodies":
            bodies = enumerate(mechanism.checked_bodies(at, p))
            told = [(f"bodies[{i}]", body.mass, body.inertia, body.planar) for i, body in bodies]
        self._owners = [(f"{owner}: {name}", planar) for name, _, _, planar in told]
        outputs = [item for _, mass, inertia, _ in told for item in (mass, ca.densify(inertia))]
        self._numbers = ca.Function("bodies", [at, symbols], outputs)

    def expect_plausible(self, q: Floats, values: Floats) -> None:
        """Raise Implausible, with body and numbers, for a mass or an inertia that no body has.

        q       joint coordinates, n x runs: the inertia of a body may depend on them
        values  of the symbols, symbols x runs
        """
        if not self._owners:
            return
        numbers = iter(over_runs(self._numbers, q, values))
        for (owner, planar), mass, inertia in zip(self._owners, numbers, numbers, strict=False):
            _expect(owner, mass[:, 0, 0], inertia, planar)


def _expect(owner: str, mass: Floats, inertia: Floats, planar: bool) -> None:
    """Raise Implausible for a body.  mass: (runs,);  inertia: (runs, 3, 3)."""
    k = _first(~(mass >= 0.0))
    if k is not None:
        raise Implausible(f"{owner}: mass: expected a number >= 0, got {mass[k]:g}", k)
    if planar:
        k = _first(~(inertia[:, 2, 2] >= 0.0))
        if k is not None:
            raise Implausible(f"{owner}: inertia: expected a number >= 0, got {inertia[k, 2, 2]:g}", k)
        return
    scale = np.abs(inertia).max(axis=(1, 2))
    uneven = np.abs(inertia - inertia.transpose(0, 2, 1)).max(axis=(1, 2))
    k = _first(~np.isfinite(scale) | ~(uneven <= _ROUNDED * scale))
    if k is not None:
        text = f"{owner}: inertia: expected a symmetric matrix of finite numbers, got {inertia[k].tolist()}"
        raise Implausible(text, k)
    moments = np.linalg.eigvalsh(inertia)
    k = _first(moments[:, 0] < -_ROUNDED * scale)
    if k is not None:
        raise Implausible(f"{owner}: inertia: expected principal moments >= 0, got {_shown(moments[k])}", k)
    k = _first(moments[:, 2] > (1 + _ROUNDED) * (moments[:, 0] + moments[:, 1]))
    if k is not None:
        text = "no body has a principal moment above the sum of the other two (an arm in a plane takes a scalar)"
        raise Implausible(f"{owner}: inertia: {text}, got {_shown(moments[k])}", k)


def _first(bad: NDArray[np.bool_]) -> int | None:
    """Index of the first that is."""
    return int(bad.argmax()) if bad.any() else None


def _shown(moments: Floats) -> str:
    return ", ".join(f"{value:g}" for value in moments)
