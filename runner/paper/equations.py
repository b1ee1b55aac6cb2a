"""The paper's equations, as docs/paper.md has and numbers them, for where they are tested."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from springline.runner.report import Equation

_LOG = r"[\ln(\epsilon |\sigma|^\nu + 1)]"

_TEX: Mapping[str, str] = {
    "1": r"M_1(q_1)\, \ddot{q}_1 + C(q_1, \dot{q}_1)\, \dot{q}_1 + G(q_1) + K (q_1 - q_2) = S",
    "1, motors": r"M_2\, \ddot{q}_2 + K (q_2 - q_1) = U",
    "11": r"\frac{d^2 \eta}{d \tau^2} + K_1 (M_2^{-1} + M_1^{-1})\, \eta = K_1 M_2^{-1} U_f",
    "14": r"U_s = H (\ddot{q}_{1d} - u_e) + C \dot{q}_1 + G, \quad H = M_1 + M_2",
    "16": r"\ddot{e} = u_e - H^{-1} S",
    "18": rf"\dot{{\sigma}} = -k_1 f(\sigma) - k_2 {_LOG}^{{1+\alpha}} \, \operatorname{{sgn}}\, \sigma "
    rf"- k_3 {_LOG}^{{1-\alpha}} \, \operatorname{{sgn}}\, \sigma",
    "19": r"f(\sigma) = |\sigma|^{\zeta \max(1, |\sigma|)} \, \operatorname{sgn}\, \sigma",
    "20": r"\dot{\sigma} = -k_1 |\sigma|^\alpha \, \operatorname{sgn}\, \sigma",
    "21": r"\dot{\sigma} = -k_1 |\sigma|^\alpha \, \operatorname{sgn}\, \sigma "
    r"- k_2 |\sigma|^\beta \, \operatorname{sgn}\, \sigma",
    "22": r"\sigma = \dot{e} + \mu\, e^{l/m} + \lambda\, e^{p/r}",
    "25": r"u_e = \dot{\sigma} - \mu \frac{l}{m} |e|^{(l-m)/m}\, \dot{e} - \lambda \frac{p}{r} |e|^{(p-r)/r}\, \dot{e}",
    "32": r"t_a = t_{s\,\mathrm{max}} + t_q",
    "33": r"U_f = K_f (\dot{q}_1 - \dot{q}_2), \quad U = U_s + U_f",
    # Those without a number
    "Theorem 1": r"t_{s\,\mathrm{max}} = \frac{1}{\mu}\, \frac{m}{l - m} + \frac{1}{\lambda}\, \frac{r}{r - p}",
    "reaching": r"t_q = \frac{2\, V(\sigma(0))^{(1-\zeta)/2}}{c_1\, 2^{(\zeta+1)/2} (1 - \zeta)}, \quad "
    r"V = \frac{|\sigma|^2}{2}, \quad k_1 - \bar{S}_0 \geq c_1 > 0",
    "layer": r"e^{p/r} \rightarrow e\, (e^2 + \delta^2)^{(p/r - 1)/2}",
    "linear": r"\sigma = \dot{e} + c\, e",
    "Runge-Kutta": r"\frac{E(t + h)}{E(t)} = 1 - \frac{(\omega h)^6}{72} + \frac{(\omega h)^8}{576}",
}
"""Number in the paper, or a name where it has none -> TeX."""

_BESIDE: Mapping[str, str] = {
    "1, motors": "(1)",
    "Theorem 1": "Theorem 1",
    "reaching": "reaching phase",
    "layer": "ours",
    "linear": "Figure 5",
    "Runge-Kutta": "RK4",
}
"""What stands beside an equation that has no number."""


def equation(name: str) -> Equation:
    """An equation by its number in the paper, or its name."""
    return Equation(_TEX[name], _BESIDE.get(name, f"({name})"))


@dataclass(frozen=True, slots=True)
class Tested:
    """What of the paper's mathematics a claim tests.

    intro      a sentence without its full stop
    equations  numbers or names of those that it is about
    """

    intro: str
    equations: tuple[str, ...]


_LAWS = ("18", "19", "20", "21")

TESTED: Mapping[int, Tested] = {
    1: Tested("The error $e$ is to vanish along the surface on which σ = 0", ("22",)),
    2: Tested(
        "What the base does to the joints is $S$ in the equations of motion, and H⁻¹S in the closed loop",
        ("1", "1, motors", "16"),
    ),
    3: Tested("Three laws are compared: variable power log, power and double power", _LAWS),
    4: Tested(
        "An error lasts where the law asks for no more than the base does, |σ̇| = |H⁻¹S|, with the surface at rest",
        ("22", *_LAWS),
    ),
    5: Tested("What chatters or does not are the laws near σ = 0", _LAWS),
    6: Tested("The base moves the joints by $S$ and H⁻¹S", ("1", "16")),
    7: Tested("The controller computes with a payload of its own, whatever the plant's is", ("14",)),
    8: Tested(
        r"Fast control damps the springs, whose force $z = K (q_2 - q_1)$ differs from its slow part by $\eta$",
        ("33", "11"),
    ),
    9: Tested("The bounds are those on sliding, on reaching and on both", ("Theorem 1", "reaching", "32")),
    10: Tested("Figure 4 shows the laws, and Figure 5 them on a surface of its own", (*_LAWS, "linear")),
    11: Tested("The law is the variable power log law, and what may chatter is its slope near σ = 0", ("18", "19")),
}
"""Number of a claim -> what it tests."""


def equations(names: Iterable[str]) -> list[Equation]:
    """Several equations, one a line."""
    return [equation(name) for name in names]
