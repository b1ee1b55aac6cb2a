"""Chains and trees of links with any numbers."""

import numpy as np

from springline.model.mechanisms import Link, Mechanism
from springline.model.parameters import Joint, Parameter


def chain(kinds, frames="generic", parents=None) -> Mechanism:
    """A chain (or tree) of links with parameters for every entry.

    kinds   "r" or "p" a joint;  frames: "generic", or "quarter" for quarter turns, exact zeros and diagonal inertias
    """
    n, declared = len(kinds), []
    for k in range(n):
        for name in ("x", "y", "z"):
            declared += [Parameter(f"{what}{k}{name}", "1", 0.0, "an entry") for what in ("o", "t", "u", "c")]
        declared += [Parameter(f"m{k}", "kg", 1.0, "mass")]
        declared += [Parameter(f"I{k}{a}{b}", "kg m^2", 0.0, "an entry") for a in "xyz" for b in "xyz" if a <= b]

    class Chain(Mechanism):
        joints = tuple(Joint(f"j{k}", "rad" if kind == "r" else "m", "N") for k, kind in enumerate(kinds))
        parameters = (*declared, Parameter("g", "m/s^2", 9.81, "gravity"))
        motor_inertia = (Parameter("rotor", "kg", 0.1, "motor", per_joint=True),)
        stiffness = (Parameter("spring", "N", 1e4, "spring", per_joint=True),)

        def links(self, p):
            return [self._link(k, p) for k in range(n)]

        def _link(self, k, p):
            def three(what):
                return tuple(p[f"{what}{k}{name}"] for name in "xyz")

            inertia = [[p[f"I{k}{min(a, b)}{max(a, b)}"] for b in "xyz"] for a in "xyz"]
            parent = k - 1 if parents is None else parents[k]
            joint = "revolute" if kinds[k] == "r" else "prismatic"
            if frames == "generic":
                return Link(f"l{k}", joint, parent, three("o"), three("t"), three("u"), p[f"m{k}"], three("c"), inertia)
            turn, place = ((np.pi / 2) * (-1) ** k, 0, 0), (0, p[f"o{k}y"], 0)
            diagonal = [[inertia[a][b] if a == b else 0 for b in range(3)] for a in range(3)]
            return Link(
                f"l{k}", joint, parent, place, turn, (0, 0, 1), p[f"m{k}"], (0, p[f"c{k}y"], p[f"c{k}z"]), diagonal
            )

    return Chain()


def numbers_for(n, rng) -> dict[str, float]:
    """Physical numbers for the parameters of `chain`: inertias of eight points of mass."""
    found = {}
    for k in range(n):
        for name in "xyz":
            found |= {
                f"o{k}{name}": rng.normal(0, 0.4),
                f"t{k}{name}": rng.uniform(-3, 3),
                f"c{k}{name}": rng.normal(0, 0.2),
            }
            found[f"u{k}{name}"] = rng.normal()
        found[f"m{k}"] = rng.uniform(0.5, 5.0)
        inertia = inertia_of(rng)
        found |= {f"I{k}{a}{b}": inertia["xyz".index(a), "xyz".index(b)] for a in "xyz" for b in "xyz" if a <= b}
    return found


def inertia_of(rng) -> np.ndarray:
    points = rng.normal(0, 0.3, (8, 3))
    points -= points.mean(axis=0)
    second = points.T @ points
    return np.trace(second) * np.eye(3) - second
