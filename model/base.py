"""The moving base: what its motion, in up to six coordinates, does to an arm that stands on it.

    surge  along X, forward           roll   theta_1x, about x, starboard down
    heave  y_r1, along Y, up          yaw    about Y, bow to port
    sway   along Z, to starboard      pitch  theta_1z, about z, bow up

Surge, heave and sway move the base's origin along the inertial axes X, Y, Z; R = Ry(yaw) Rz(pitch) Rx(roll) takes base
axes to inertial ones. The paper has shake (heave), pitch and roll, and combines them so (E7). The arm feels the base
only through what an inertial measurement unit at its foot reads: the angular velocity, its derivative, and the specific
force (gravity plus acceleration), in the arm's axes. Its foot stands at `mount` in the base's axes, and its axes are
turned by Ry(yaw) Rz(pitch) Rx(roll) of `mount_rpy`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from springline.model import lazy_casadi as ca


@dataclass(frozen=True, slots=True)
class BaseCoordinate:
    """One coordinate of the base's motion.

    key       in scenario files;  alias: another name for it there, and its name in C
    symbol    of its column in a trajectory and of its member in C
    unit      SI
    positive  which way it goes as it grows
    """

    key: str
    symbol: str
    unit: str
    positive: str
    alias: str = ""


COORDINATES = (
    BaseCoordinate("heave", "y_r1", "m", "up", "shake"),
    BaseCoordinate("pitch", "theta_1z", "rad", "bow up"),
    BaseCoordinate("roll", "theta_1x", "rad", "starboard down"),
    BaseCoordinate("surge", "surge", "m", "forward"),
    BaseCoordinate("sway", "sway", "m", "to starboard"),
    BaseCoordinate("yaw", "yaw", "rad", "bow to port"),
)
"""All of them, in the order of b."""

PAPER_COORDINATES = COORDINATES[:3]
"""Those of the paper, which are always there; the others are where they move."""

ALIASES = {c.alias: c.key for c in COORDINATES if c.alias}
"""Another name of a coordinate in scenario files -> its key."""

MOTION_ORDER = ("surge", "sway", "heave", "roll", "pitch", "yaw")
"""The order in which people name them."""

MOUNT = (("x", "m", "forward"), ("y", "m", "up"), ("z", "m", "to starboard"))
MOUNT_RPY = (("roll", "rad", "about x"), ("pitch", "rad", "about z"), ("yaw", "rad", "about y"))
"""Name, unit and meaning of what [base_motion] mount and mount_rpy consist of."""


def moving(terms: Sequence[int]) -> tuple[BaseCoordinate, ...]:
    """The coordinates of a base with so many terms for each of COORDINATES: the paper's and those that have any.

    Zeros at the end of `terms` may be left out.
    """
    others = zip(COORDINATES[len(PAPER_COORDINATES) :], terms[len(PAPER_COORDINATES) :], strict=False)
    return PAPER_COORDINATES + tuple(coordinate for coordinate, count in others if count)


def shortest(terms: Sequence[int]) -> tuple[int, ...]:
    """Terms for each of COORDINATES without zeros at the end that may be left out, so that equal motions are equal."""
    count = len(terms)
    while count > len(PAPER_COORDINATES) and not terms[count - 1]:
        count -= 1
    return tuple(terms[:count])


def turned(roll: ca.SX, pitch: ca.SX, yaw: ca.SX | None = None) -> ca.SX:
    """Ry(yaw) Rz(pitch) Rx(roll), 3 x 3; without yaw where there is none."""
    cz, sz = ca.cos(pitch), ca.sin(pitch)
    cx, sx = ca.cos(roll), ca.sin(roll)
    tilted = ca.blockcat([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ ca.blockcat([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return tilted if yaw is None else _about_y(yaw) @ tilted


def _about_y(yaw: ca.SX) -> ca.SX:
    cy, sy = ca.cos(yaw), ca.sin(yaw)
    return ca.blockcat([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])


@dataclass(frozen=True, slots=True)
class BaseState:
    """Position, rate and acceleration of the base, and how the arm stands on it.

    b, db, ddb   one entry per coordinate (m or rad, per s, per s^2), symbols
    coordinates  what they are of
    mount        3 x 1, m, base axes: where the arm's foot is; None at the base's origin
    mount_rpy    3 x 1, rad: roll, pitch and yaw of the arm's axes on the base; None where they are the base's
    """

    b: ca.SX
    db: ca.SX
    ddb: ca.SX
    coordinates: tuple[BaseCoordinate, ...] = PAPER_COORDINATES
    mount: ca.SX | None = None
    mount_rpy: ca.SX | None = None

    @property
    def constants(self) -> ca.SX:
        """The symbols of the mount, as a column: what the properties here depend on besides the motion."""
        given = [item for item in (self.mount, self.mount_rpy) if item is not None]
        return ca.vertcat(ca.SX(0, 1), *given)

    @property
    def rotation(self) -> ca.SX:
        """R, 3 x 3: base axes to inertial axes."""
        return turned(self._of(self.b, "roll"), self._of(self.b, "pitch"), self._find(self.b, "yaw"))

    @property
    def position(self) -> ca.SX:
        """The base's origin, 3 x 1, m, inertial axes."""
        return ca.vertcat(*(self._of(self.b, key) for key in ("surge", "heave", "sway")))

    def on_ship(self, point: ca.SX) -> ca.SX:
        """A point given in the arm's axes, from its foot, in the ship's from her origin; 3 x 1, m."""
        seen = point if self.mount_rpy is None else turned(*ca.vertsplit(self.mount_rpy)) @ point
        return seen if self.mount is None else self.mount + seen

    @property
    def omega(self) -> ca.SX:
        """Angular velocity, 3 x 1, rad/s, arm axes."""
        return self._in_arm_axes(self._omega)

    @property
    def alpha(self) -> ca.SX:
        """Angular acceleration, 3 x 1, rad/s^2, arm axes."""
        return self._in_arm_axes(self._alpha)

    def specific_force(self, g: ca.SX) -> ca.SX:
        """Acceleration of the arm's foot plus g along the inertial Y, 3 x 1, m/s^2, arm axes."""
        return self._in_arm_axes(self._with_drift(self._tilt.T @ ca.vertcat(0, g + self._of(self.ddb, "heave"), 0)))

    def excess_force(self, g: ca.SX) -> ca.SX:
        """`specific_force` less `rest_force`, 3 x 1, m/s^2, written so that a small excess keeps its digits."""
        level = ca.vertcat(0, 1, 0)
        up = self._tilt.T @ level
        return self._in_arm_axes(self._with_drift(g * (up - level) + self._of(self.ddb, "heave") * up))

    def rest_force(self, g: ca.SX) -> ca.SX:
        """The specific force with the base at rest and level, 3 x 1, m/s^2, arm axes."""
        return self._in_arm_axes(ca.vertcat(0, g, 0))

    # In base axes, and only what moves

    def _find(self, values: ca.SX, key: str) -> ca.SX | None:
        """The entry of a coordinate, None where it does not move."""
        return next((values[i] for i, item in enumerate(self.coordinates) if item.key == key), None)

    def _of(self, values: ca.SX, key: str) -> ca.SX:
        """The entry of a coordinate, zero where it does not move."""
        found = self._find(values, key)
        return ca.SX(0) if found is None else found

    @property
    def _tilt(self) -> ca.SX:
        """Rz(pitch) Rx(roll): which way is up does not depend on the yaw."""
        return turned(self._of(self.b, "roll"), self._of(self.b, "pitch"))

    @property
    def _omega(self) -> ca.SX:
        """Roll rate along x, pitch rate along z before the roll, yaw rate along the inertial Y."""
        roll = self._of(self.b, "roll")
        pitching, rolling = self._of(self.db, "pitch"), self._of(self.db, "roll")
        omega = ca.vertcat(rolling, pitching * ca.sin(roll), pitching * ca.cos(roll))
        yawing = self._find(self.db, "yaw")
        return omega if yawing is None else omega + yawing * (self._tilt.T @ ca.vertcat(0, 1, 0))

    @property
    def _alpha(self) -> ca.SX:
        return ca.jtimes(self._omega, ca.vertcat(self.b, self.db), ca.vertcat(self.db, self.ddb))

    def _with_drift(self, force: ca.SX) -> ca.SX:
        """A specific force of the base's heave and tilt, plus what surge, sway and the foot's distance add."""
        if {"surge", "sway"} & {item.key for item in self.coordinates}:
            yaw, drift = (
                self._find(self.b, "yaw"),
                ca.vertcat(self._of(self.ddb, "surge"), 0, self._of(self.ddb, "sway")),
            )
            force = force + self._tilt.T @ (drift if yaw is None else _about_y(yaw).T @ drift)
        if self.mount is not None:
            omega = self._omega
            force = force + ca.cross(self._alpha, self.mount) + ca.cross(omega, ca.cross(omega, self.mount))
        return force

    def _in_arm_axes(self, vector: ca.SX) -> ca.SX:
        if self.mount_rpy is None:
            return vector
        return turned(*ca.vertsplit(self.mount_rpy)).T @ vector
