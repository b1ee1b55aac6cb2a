"""The moving base: what its oscillation b = [y_r1, theta_1z, theta_1x] does to a body that stands on it.

The base frame is moved by y_r1 along the inertial Y and turned by R = Rz(theta_1z) Rx(theta_1x) (E7: pitch, then
roll about the pitched x axis). The arm feels the base only through what an inertial measurement unit at the base
origin reads: the angular velocity, its derivative, and the specific force (gravity plus acceleration), in base axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True, slots=True)
class BaseCoordinate:
    """One oscillation of the base: scenario key, symbol and SI unit."""

    key: str
    symbol: str
    unit: str


COORDINATES = (
    BaseCoordinate("shake", "y_r1", "m"),
    BaseCoordinate("pitch", "theta_1z", "rad"),
    BaseCoordinate("roll", "theta_1x", "rad"),
)


@dataclass(frozen=True, slots=True)
class BaseMotion:
    """Oscillation b, its rate and acceleration, each 3 x 1 (m or rad, per s, per s^2)."""

    b: ca.SX
    db: ca.SX
    ddb: ca.SX

    @property
    def rotation(self) -> ca.SX:
        """R, 3 x 3: base axes to inertial axes."""
        cz, sz = ca.cos(self.b[1]), ca.sin(self.b[1])
        cx, sx = ca.cos(self.b[2]), ca.sin(self.b[2])
        pitch = ca.blockcat([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        roll = ca.blockcat([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        return pitch @ roll

    @property
    def position(self) -> ca.SX:
        """The base's origin, 3 x 1, m, inertial axes."""
        return ca.vertcat(0, self.b[0], 0)

    def on_ship(self, point: ca.SX) -> ca.SX:
        """A point of the arm's axes in the ship's, 3 x 1, m: the same, for the arm stands at the base's origin."""
        return point

    @property
    def omega(self) -> ca.SX:
        """Angular velocity, 3 x 1, rad/s, base axes: roll rate along x plus pitch rate along the inertial z."""
        return ca.vertcat(self.db[2], self.db[1] * ca.sin(self.b[2]), self.db[1] * ca.cos(self.b[2]))

    @property
    def alpha(self) -> ca.SX:
        """Angular acceleration, 3 x 1, rad/s^2, base axes."""
        return ca.jtimes(self.omega, ca.vertcat(self.b, self.db), ca.vertcat(self.db, self.ddb))

    def specific_force(self, g: ca.SX) -> ca.SX:
        """(g + acceleration of the shake) along the inertial Y, 3 x 1, m/s^2, base axes; [0, g, 0] at rest."""
        return self.rotation.T @ ca.vertcat(0, g + self.ddb[0], 0)

    def excess_force(self, g: ca.SX) -> ca.SX:
        """`specific_force` less [0, g, 0], 3 x 1, m/s^2, written so that a small excess keeps its digits."""
        level = ca.vertcat(0, 1, 0)
        up = self.rotation.T @ level
        return g * (up - level) + self.ddb[0] * up
