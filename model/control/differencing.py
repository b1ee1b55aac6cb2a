"""Rates that a controller makes out by itself, of the positions that it samples: [sensor] velocity = "differenced".

    v_k = a v_{k-1} + (1 - a) (q_k - q_{k-1}) / h,    a = exp(-w h)

That is the backward difference, the mean rate since the sample before, behind a low-pass of first order with cutoff w:
exact for it where q goes straight from sample to sample. v is late by h/2 of the difference and 1/w of the filter;
without a cutoff, w infinite, it is the difference alone. At the first sample there is no position before, and v is 0.
R. H. Brown, S. C. Schneider, M. G. Mulligan, IEEE Trans. Ind. Electron. 39 (1992) 11-19, compare such estimates.

It belongs to the controller, which is told of positions alone: what it remembers stands behind the states of the
controller and the observer, which read the rates as y.dq1 and y.dq2 and need to know of nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from springline.model import lazy_casadi as ca
from springline.model.control.controller import states_of
from springline.model.parameters import LIMIT, Joint, Parameter
from springline.model.quantities import DERIVATIVES, Q1, Q2, Quantity
from springline.model.terms import named, section

VELOCITY_CUTOFF = Parameter(
    "velocity_cutoff", "rad/s", math.inf, "cutoff of the low-pass behind differenced positions", LIMIT, per_joint=True
)

_BEGUN = Quantity("has_last", "k > 0", "1", "whether there is a sample before to difference with", per="scalar")


def _last(position: Quantity) -> Quantity:
    return Quantity(
        f"{position.name}_last", rf"{position.symbol}^-", "{q}", f"{position.meaning}, at the sample before"
    )


def _rate(position: Quantity) -> Quantity:
    rate = DERIVATIVES[position]
    return Quantity(f"{rate.name}_diff", rf"\hat{{{rate.symbol}}}", "{q}/s", f"{rate.meaning}, of differences")


def differencing_states(state: Sequence[Quantity]) -> tuple[Quantity, ...]:
    """What it remembers of a state's positions: each at the sample before, its rate then, whether there was one."""
    positions = [item for item in state if item in (Q1, Q2)]
    return (*(made(item) for item in positions for made in (_last, _rate)), _BEGUN)


def differenced(
    state: Mapping[Quantity, ca.SX], joints: Sequence[Joint], z: ca.SX, cutoff: ca.SX, h: ca.SX
) -> tuple[dict[Quantity, ca.SX], ca.SX]:
    """Rates in place of the state's, n x 1 each, and what is remembered after the sample.

    state   measured, of which positions are read;  z: what `differencing_states` declares, as one column
    cutoff  n x 1, rad/s;  h: the sample period, s
    """
    declared = differencing_states(tuple(state))
    before, rates, after = states_of(declared, joints, z), {}, []
    with section("rates of differenced positions", "docs/scenarios.md"):
        kept = named("kept_of_rate", ca.exp(-cutoff * h))
        for position, q in state.items():
            if position not in (Q1, Q2):
                continue
            difference = before[_BEGUN.name] * (q - before[_last(position).name]) / h
            rate = kept * before[_rate(position).name] + (1 - kept) * difference
            rates[DERIVATIVES[position]] = named(_rate(position).name, rate)
            after += [q, rate]
    return rates, ca.vertcat(*after, 1)
