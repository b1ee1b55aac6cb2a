"""Where the arm ends: its tip as seen from the ship and from the earth, and how fast it moves there."""

from __future__ import annotations

from springline.model import lazy_casadi as ca
from springline.model.base import BaseState


def tip_motion(tip: ca.SX, q: ca.SX, dq: ca.SX, base: BaseState) -> ca.SX:
    """Position and rate of a point of the arm, 12 x 1, m and m/s, in the order of quantities.TIP and TIP_RATE.

    tip  3 x 1, arm axes, of q;  q, dq  n x 1;  entries of q and base.b are symbols
    """
    ship = base.on_ship(tip)
    inertial = base.position + base.rotation @ ship
    return ca.vertcat(
        ship,
        inertial,
        ca.jtimes(ship, q, dq),
        ca.jtimes(inertial, ca.vertcat(q, base.b), ca.vertcat(dq, base.db)),
    )
