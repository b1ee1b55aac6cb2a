"""The loop linearised, symbolically: plant and control by automatic differentiation, a law by what stands before it.

Differentiated where the error is zero, a law of sigma is not seen at all, or has no bound. So the controller is cut at
its sliding variable: new symbols s stand for sigma in all that it computes, and the loop has, with the equivalent gain
N of the command by s at some amplitude (its describing function, which is a matter of numbers),

    du = (du/dx at fixed s) dx + N (dsigma/dx) dx,   likewise for the states z and their rates

Sensors are taken as they are without noise and steps, commands as they are before the limits U_max.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from springline.model import lazy_casadi as ca
from springline.model.structure import Structure
from springline.model.symbolic import as_written, derivation, derived_property, replaced_values
from springline.model.system import System, system_of

CONTROL_INPUTS = ("w", "x", "z", "s", "h", "p")
"""Arguments of the Functions of the control, in order; s and h: sigma's place, and the sample period, s."""


class Linearisation:
    """Functions of one System, all parameters symbolic. Raises ValueError for a controller that cannot be cut.

    plant      (w, x, u, p) -> dx and its derivatives by x, u
    control    (w, x, z, s, h, p) -> u, dz, ahead, and of each the derivatives by x, z; sigma and its likewise
    held       the same of a control that is sampled with the period h and makes out its rates of differences: z has
               what it remembers for that, dz is empty. None where rates are measured: `control` says it all
    by_sigma, held_by_sigma  (w, x, z, s, h, p) -> u, dz, ahead: what an equivalent gain is computed from
    law        (w, x, z, s, h, p) -> what the reaching law asks for before a_max, but for its sign; zero without one
    euler      whether z goes on by an explicit Euler step where the control is sampled
    cut        whether there is a sliding variable, and so an s; it has no entries otherwise
    """

    def __init__(self, system: System) -> None:
        self.system = system
        self.cut = bool(system.sliding)

    @derived_property
    def plant(self) -> ca.Function:
        """dx (nx x 1), by x (nx x nx), by u (nx x n)."""
        system = self.system
        x, u, p = (
            ca.SX.sym(name, symbol.numel()) for name, symbol in (("x", system.x), ("u", system.u), ("p", system.p))
        )
        w = ca.SX.sym("w", system.w.numel())
        dx = system.function("loop_plant")(w, x, u, p)
        results = [dx, ca.jacobian(dx, x), ca.jacobian(dx, u)]
        return ca.Function("linear_plant", [w, x, u, p], _common(results), ["w", "x", "u", "p"], ["dx", "A", "B"])

    @derived_property
    def _written(self) -> tuple[ca.SX, list[ca.SX], ca.SX, ca.SX]:
        """s; u, dz, ahead of it; sigma; the law's acceleration of s."""
        system = self.system
        signals = system.stated_control
        s = ca.SX.sym("s", system.n if self.cut else 0)
        results = [signals.command, signals.dz, signals.ahead, signals.a_law]
        if self.cut:
            *results, _ = replaced_values([*results, signals.sigma], signals.sigma, s)
            owner = f"controller {system.controller.name}"
            if not ca.depends_on(signals.sigma, system.x):
                raise ValueError(f"{owner}: sigma does not depend on the state: no gain of it can be told")
            if not ca.depends_on(ca.vertcat(*results[:2]), s):
                raise ValueError(
                    f"{owner}: neither u nor dz is computed from the sigma that diagnostics has: "
                    "expected the same expression in both places"
                )
        *results, law = results
        return s, results, signals.sigma, law

    @derived_property
    def euler(self) -> bool:
        """Whether an explicit Euler step takes z to the next sample."""
        signals = self.system.stated_control
        step = self.system.z[: self.own_states] + self.system.h * signals.dz
        return bool(ca.is_equal(ca.densify(signals.ahead), ca.densify(step), 8))

    @derived_property
    def control(self) -> ca.Function:
        """u, dz, ahead, sigma, each followed by its derivatives by x and z: of a continuous control, by z without what
        differences are made of.
        """
        s, results, sigma, _ = self._written
        return self._derived("linear_control", s, results, sigma, self.system.z[: self.own_states])

    @derived_property
    def held(self) -> ca.Function | None:
        """The same of a sampled control whose rates are made of differences."""
        if not self.system.structure.differenced:
            return None
        s, results, sigma = self._told
        return self._derived("linear_held", s, results, sigma, self.system.z)

    @property
    def own_states(self) -> int:
        """How many entries of z, its first, are not what differences are made of."""
        return int(self.system.stated_control.dz.numel())

    @derived_property
    def _told(self) -> tuple[ca.SX, list[ca.SX], ca.SX]:
        """s; u, nothing for dz, ahead; sigma: with the rates that are made of differences."""
        s, (command, _, ahead), sigma, _ = self._written
        told, remembered = self.system.told()
        with as_written():
            command, ahead, sigma = ca.substitute([command, ahead, sigma], [self.system.x], [told])
        return s, [command, ca.SX(0, 1), ca.vertcat(ahead, remembered)], sigma

    def _derived(self, name: str, s: ca.SX, results: Sequence[ca.SX], sigma: ca.SX, z: ca.SX) -> ca.Function:
        x = self.system.x
        outputs = [
            item for value in (*results, sigma) for item in (value, ca.jacobian(value, x), ca.jacobian(value, z))
        ]
        names = [f"{name}{by}" for name in ("u", "dz", "ahead", "sigma") for by in ("", "_x", "_z")]
        return self._function(name, s, outputs, names)

    @derived_property
    def by_sigma(self) -> ca.Function:
        """u, dz, ahead."""
        s, results, _, _ = self._written
        return self._function("control_by_sigma", s, results, ["u", "dz", "ahead"])

    @derived_property
    def held_by_sigma(self) -> ca.Function:
        """u, nothing, ahead, with rates that are made of differences."""
        s, results, _ = self._told
        return self._function("held_by_sigma", s, results, ["u", "dz", "ahead"])

    @derived_property
    def law(self) -> ca.Function:
        """The law's acceleration, but for its sign, n x 1."""
        s, _, _, law = self._written
        return self._function("law_by_sigma", s, [law], ["a_law"])

    def reads(self, key: str) -> bool:
        """Whether command or rates of the states depend on the parameter `key`, or on an entry of it."""
        symbols = [
            symbol
            for symbol, slot in zip(ca.vertsplit(self.system.p), self.system.slots, strict=True)
            if slot.key == key or slot.key.rpartition(".")[0] == key
        ]
        return bool(symbols) and bool(ca.depends_on(ca.vertcat(*self._written[1]), ca.vertcat(*symbols)))

    def _function(self, name: str, s: ca.SX, outputs: Sequence[ca.SX], names: list[str]) -> ca.Function:
        system = self.system
        inputs = [system.w, system.x, system.z, s, system.h, system.p]
        return ca.Function(name, inputs, _common(outputs), list(CONTROL_INPUTS), names)


def _common(outputs: Sequence[ca.SX]) -> list[ca.SX]:
    with as_written():
        found: list[ca.SX] = ca.cse([ca.SX(item) for item in outputs])
        return found


@derivation
@lru_cache(maxsize=64)
def linearisation_of(structure: Structure) -> Linearisation:
    """The Linearisation of a structure; the same object for equal structures, so that it is derived once."""
    return Linearisation(system_of(structure))
