"""Metrics: what a run is judged by. Each is one declaration, from which the kernel's C is printed.

A metric is computed for each joint while a run goes on, so that no trajectory need be kept. Samples are taken at the
beginning of every step, and at the end. A `Fold` is what is gathered over samples; a metric's value is an expression of
its folds and of what is known at the end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from springline.model import lazy_casadi as ca
from springline.model.quantities import Quantity

Kind = Literal["largest", "smallest", "integral", "mean", "variation", "first", "last"]
Part = Literal["run", "second half", "last quarter", "settled"]


@dataclass(frozen=True, slots=True)
class Sample:
    """A joint at one time, as symbols: each is what model/quantities.py says of its name."""

    e: ca.SX
    U: ca.SX
    sigma: ca.SX
    q1: ca.SX
    dq1: ca.SX
    q2: ca.SX
    dq2: ca.SX

    @classmethod
    def symbols(cls, prefix: str = "") -> Sample:
        """New symbols, whose names begin with `prefix`."""
        return cls(*(ca.SX.sym(prefix + name) for name in cls.__dataclass_fields__))


@dataclass(frozen=True, slots=True)
class Settings:
    """The thresholds of [simulation] as the loop has them, as symbols: of each kind the band or the error is 0."""

    response_band: ca.SX
    response_error: ca.SX
    settling_band: ca.SX
    settling_error: ca.SX


@dataclass(frozen=True, slots=True)
class Run:
    """What is known at the end, as symbols.

    start     when the run began, s;  duration: how long it lasted, s
    half      length of its second half, had it gone on to its end, s
    complete  whether it did, 1 or 0
    """

    start: ca.SX
    duration: ca.SX
    half: ca.SX
    complete: ca.SX


def symbols(group: Sample | Settings | Run) -> dict[str, ca.SX]:
    """Name -> symbol."""
    return {name: getattr(group, name) for name in group.__dataclass_fields__}


NOW, FIRST = Sample.symbols(), Sample.symbols("first_")
SETTINGS = Settings(*map(ca.SX.sym, Settings.__dataclass_fields__))
RUN = Run(*map(ca.SX.sym, Run.__dataclass_fields__))


@dataclass(frozen=True, eq=False, slots=True)
class Fold:
    """What is gathered over the samples of a part of the run.

    kind   "largest", "smallest": of the samples;  "integral": over time, by the trapezoid rule;  "mean": that, by the
           time, or the last sample where no time passed;  "variation": the sum of |change| from sample to sample
           "first", "last": s, the time when `of` was true; infinity and 0 where it never was
    of     an expression of `NOW`, `FIRST` and `SETTINGS`
    part   "settled" is from the last time outside the settling band on
    Two metrics that share a Fold compute it once. Raises ValueError for what is computed for the whole run only.
    """

    kind: Kind
    of: ca.SX
    part: Part = "run"

    def __post_init__(self) -> None:
        if self.kind in ("mean", "first", "last") and self.part != "run":
            raise ValueError(f"a fold of kind {self.kind!r} is of the whole run, not of part {self.part!r}")


def _itself(fold: ca.SX) -> ca.SX:
    return fold


def _always(*_: ca.SX) -> ca.SX:
    return ca.SX(1)


@dataclass(frozen=True, slots=True)
class Metric(Quantity):
    """A Quantity that is computed from folds. Give folds, value and exists by name.

    value   of what the folds give, in their order
    exists  of the same: where it is 0 there is no such value, and a table has null
    There is none either for a run without a sample, for a part of a run that stopped before its end or never settled,
    and where the system lacks what is folded: sigma without a sliding surface, q2 with a rigid drive.
    """

    folds: tuple[Fold, ...] = ()
    value: Callable[..., ca.SX] = _itself
    exists: Callable[..., ca.SX] = _always


def _is_complete() -> ca.SX:
    return RUN.complete


def _has_settled(last_outside: ca.SX) -> ca.SX:
    in_time = last_outside <= RUN.start + 0.98 * RUN.duration
    return ca.logic_and(ca.logic_and(RUN.complete, _SETTLING_BAND > 0), in_time)


def _root(mean: ca.SX) -> ca.SX:
    return ca.sqrt(ca.fmax(mean, 0))


def _swings(variation: ca.SX, largest: ca.SX, smallest: ca.SX, size: ca.SX) -> ca.SX:
    return ca.if_else(variation > 0, variation / RUN.half / ca.fmax(largest - smallest, 1e-3 * size), 0)


_ERROR = ca.fabs(NOW.e)
_RESPONSE_BAND = ca.fabs(FIRST.e) * SETTINGS.response_band + SETTINGS.response_error
_SETTLING_BAND = ca.fabs(FIRST.e) * SETTINGS.settling_band + SETTINGS.settling_error
OUTSIDE = _ERROR > _SETTLING_BAND
"""Whether a sample is outside the settling band: the part "settled" begins with the last that is."""
_LAST_OUTSIDE = Fold("last", OUTSIDE)
_LARGEST_U = Fold("largest", ca.fabs(NOW.U))

PARTS: dict[Part, tuple[tuple[Fold, ...], Callable[..., ca.SX]]] = {
    "run": ((), _always),
    "second half": ((), _is_complete),
    "last quarter": ((), _is_complete),
    "settled": ((_LAST_OUTSIDE,), _has_settled),
}
"""Part of a run -> whether there is one: folds, and the condition on what they give."""

METRICS = (
    Metric(
        "response_time",
        "t_r",
        "s",
        "first time with |e| inside the response band",
        folds=(Fold("first", _ERROR <= _RESPONSE_BAND),),
        exists=lambda time: ca.logic_and(_RESPONSE_BAND > 0, time < ca.inf),
    ),
    Metric(
        "settling_time",
        "t_s",
        "s",
        "last time with |e| outside the settling band, unless in the last 2 % of the run",
        folds=(_LAST_OUTSIDE,),
        exists=_has_settled,
    ),
    Metric(
        "overshoot",
        r"e_o",
        "{q}",
        "largest excursion of e past zero, against the sign of e(0)",
        folds=(Fold("largest", -(NOW.e * ca.sign(FIRST.e))),),
        value=lambda excursion: ca.fmax(ca.SX(0), excursion),
        exists=lambda _: FIRST.e != 0,
    ),
    Metric(
        "steady_state_error",
        r"e_\infty",
        "{q}",
        "largest |e| over the last quarter of the run",
        folds=(Fold("largest", _ERROR, "last quarter"),),
    ),
    Metric(
        "rms_error",
        r"e_{rms}",
        "{q}",
        "root of the mean of e^2, by the trapezoid rule",
        folds=(Fold("mean", _ERROR * _ERROR),),
        value=_root,
    ),
    Metric("iae", r"\int |e|", "{q} s", "integral of |e|, by the trapezoid rule", folds=(Fold("integral", _ERROR),)),
    Metric("U_max", r"U_{max}", "{F}", "largest |U|", folds=(_LARGEST_U,)),
    Metric(
        "U_rms",
        r"U_{rms}",
        "{F}",
        "root of the mean of U^2, by the trapezoid rule",
        folds=(Fold("mean", NOW.U * NOW.U),),
        value=_root,
    ),
    Metric(
        "chatter",
        "c",
        "1/s",
        "total variation of U over the second half of the run, by that half's length and by the larger of the range of "
        "U in it and 1e-3 of U_max; 0 for a U that stands still",
        folds=(
            Fold("variation", NOW.U, "second half"),
            Fold("largest", NOW.U, "second half"),
            Fold("smallest", NOW.U, "second half"),
            _LARGEST_U,
        ),
        value=_swings,
    ),
    Metric(
        "U_tv",
        "TV(U)",
        "{F}",
        "total variation of U after the settling time",
        folds=(Fold("variation", NOW.U, "settled"),),
    ),
    Metric(
        "sigma_tv",
        r"TV(\sigma)",
        "{q}/s",
        "total variation of the sliding variable after the settling time",
        folds=(Fold("variation", NOW.sigma, "settled"),),
    ),
    Metric(
        "dq1_tv",
        r"TV(\dot q_1)",
        "{q}/s",
        "total variation of the joint rate after the settling time",
        folds=(Fold("variation", NOW.dq1, "settled"),),
    ),
)
"""What a run is judged by, in the order of the columns. Null where there is none: never reached, not settled,
e(0) = 0, or the run stopped before."""
