"""Explicit Runge-Kutta methods with a fixed step, as data: a new one is a Tableau here.

k_i = f(t + c_i h, x + h sum_j a_ij k_j),    x(t + h) = x + h sum_i b_i k_i
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

Number = int | float | Fraction


@dataclass(frozen=True)
class Tableau:
    """An explicit method of s stages.

    name   in scenario files
    title  for people
    order  of convergence
    a      for every stage the factors of the stages before it: s rows of 0, 1, ... s-1 numbers
    b      factors of the sum, s numbers
    c      times of the stages, s numbers in 0 .. 1, the first one 0
    Raises ValueError for numbers of another shape or that do not fit together (c_i = sum_j a_ij, sum_i b_i = 1).
    """

    name: str
    title: str
    order: int
    a: tuple[tuple[Number, ...], ...]
    b: tuple[Number, ...]
    c: tuple[Number, ...]

    def __post_init__(self) -> None:
        stages = len(self.b)
        if len(self.a) != stages or len(self.c) != stages or [len(row) for row in self.a] != list(range(stages)):
            raise ValueError(f"tableau {self.name}: expected {stages} rows of 0 to {stages - 1} factors")
        sums = [*zip(self.c, map(sum, self.a), strict=True), (1, sum(self.b))]
        if self.c[0] != 0 or any(abs(float(left - right)) > 1e-14 for left, right in sums):
            raise ValueError(f"tableau {self.name}: expected c = row sums, from 0 on, and sum b = 1")
        if not all(0 <= c <= 1 for c in self.c):
            raise ValueError(f"tableau {self.name}: expected times within the step, 0 to 1")

    @property
    def stages(self) -> int:
        """Number of evaluations a step."""
        return len(self.b)

    @cached_property
    def nodes(self) -> tuple[float, ...]:
        """Times at which the stages need the signals, as fractions of the step: ascending, each once."""
        return tuple(sorted({float(c) for c in self.c}))

    @cached_property
    def when(self) -> tuple[int, ...]:
        """For every stage the place of its time among the nodes."""
        return tuple(self.nodes.index(float(c)) for c in self.c)


def _numbers(text: str) -> tuple[Fraction, ...]:
    """Fractions or decimals, as they stand in books."""
    return tuple(map(Fraction, text.split()))


EULER = Tableau("euler", "Euler", 1, a=((),), b=(1,), c=(0,))

MIDPOINT = Tableau("midpoint", "midpoint", 2, a=((), _numbers("1/2")), b=(0, 1), c=_numbers("0 1/2"))

RK4 = Tableau(
    "rk4",
    "classical Runge-Kutta",
    4,
    a=((), _numbers("1/2"), _numbers("0 1/2"), _numbers("0 0 1")),
    b=_numbers("1/6 1/3 1/3 1/6"),
    c=_numbers("0 1/2 1/2 1"),
)

# Dormand and Prince 1980, "A family of embedded Runge-Kutta formulae": the method of order 5.
DOPRI5 = Tableau(
    "dopri5",
    "Dormand-Prince 5",
    5,
    a=(
        (),
        _numbers("1/5"),
        _numbers("3/40 9/40"),
        _numbers("44/45 -56/15 32/9"),
        _numbers("19372/6561 -25360/2187 64448/6561 -212/729"),
        _numbers("9017/3168 -355/33 46732/5247 49/176 -5103/18656"),
    ),
    b=_numbers("35/384 0 500/1113 125/192 -2187/6784 11/84"),
    c=_numbers("0 1/5 3/10 4/5 8/9 1"),
)

# Hairer, Norsett and Wanner, "Solving Ordinary Differential Equations I", section II.5: the method of order 8.
DOP853 = Tableau(
    "dop853",
    "Dormand-Prince 8",
    8,
    a=(
        (),
        _numbers("0.05260015195876773"),
        _numbers("0.0197250569845379 0.0591751709536137"),
        _numbers("0.02958758547680685 0 0.08876275643042054"),
        _numbers("0.2413651341592667 0 -0.8845494793282861 0.924834003261792"),
        _numbers("0.037037037037037035 0 0 0.17082860872947386 0.12546768756682242"),
        _numbers("0.037109375 0 0 0.17025221101954405 0.06021653898045596 -0.017578125"),
        _numbers(
            "0.03709200011850479 0 0 0.17038392571223998 0.10726203044637328 -0.015319437748624402 0.008273789163814023"
        ),
        _numbers(
            "0.6241109587160757 0 0 -3.3608926294469414 -0.868219346841726 27.59209969944671 20.154067550477894 "
            "-43.48988418106996"
        ),
        _numbers(
            "0.47766253643826434 0 0 -2.4881146199716677 -0.590290826836843 21.230051448181193 "
            "15.279233632882423 -33.28821096898486 -0.020331201708508627"
        ),
        _numbers(
            "-0.9371424300859873 0 0 5.186372428844064 1.0914373489967295 -8.149787010746927 -18.52006565999696 "
            "22.739487099350505 2.4936055526796523 -3.0467644718982196"
        ),
        _numbers(
            "2.273310147516538 0 0 -10.53449546673725 -2.0008720582248625 -17.9589318631188 27.94888452941996 "
            "-2.8589982771350235 -8.87285693353063 12.360567175794303 0.6433927460157636"
        ),
    ),
    b=_numbers(
        "0.054293734116568765 0 0 0 0 4.450312892752409 1.8915178993145003 -5.801203960010585 "
        "0.3111643669578199 -0.1521609496625161 0.20136540080403034 0.04471061572777259"
    ),
    c=_numbers(
        "0 0.05260015195876773 0.0789002279381516 0.1183503419072274 0.2816496580927726 0.3333333333333333 "
        "0.25 0.3076923076923077 0.6512820512820513 0.6 0.8571428571428571 1"
    ),
)

_ALL = (EULER, MIDPOINT, RK4, DOPRI5, DOP853)
INTEGRATORS: dict[str, Tableau] = {tableau.name: tableau for tableau in _ALL}
