"""The three main axes of the Manutec r3, an industrial robot with elastic gears, its wrist locked.

Numbers: S. Türk, M. Otter, "Das DFVLR-Modell Nr. 1 des Industrieroboters Manutec r3", Robotersysteme 3 (1987), as the
Modelica Standard Library has them (Modelica.Mechanics.MultiBody.Examples.Systems.RobotR3, BSD 3-clause). Axes are the
library's, which are springline's: x forward, y up. Springs, motors and frictions are there on the motor's side of the
gear; here they are seen at the joint, times the square of the gear's ratio.
"""

import math

import casadi as ca

from springline.model import Joint, Link, Mechanism, Parameter
from springline.model.signals import SineTerm


def about(axis, angle):
    """Rotation about x or y, 3 x 3."""
    c, s = ca.cos(angle), ca.sin(angle)
    if axis == "x":
        return ca.blockcat([[1, 0, 0], [0, c, -s], [0, s, c]])
    return ca.blockcat([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def lumped(parts):
    """Mass, centre and inertia about it of several parts: (mass, position, inertia about the part's centre)."""
    mass = sum(m for m, _, _ in parts)
    centre = sum(m * r for m, r, _ in parts) / mass
    inertia = ca.SX.zeros(3, 3)
    for m, r, own in parts:
        d = r - centre
        inertia += own + m * (ca.dot(d, d) * ca.SX.eye(3) - d @ d.T)
    return mass, centre, inertia


class ManutecR3(Mechanism):
    """Swivel, shoulder and elbow; the wrist holds its load where `wrist_4` and `wrist_5` say."""

    joints = (
        Joint("swivel", "rad", "N m"),
        Joint("shoulder", "rad", "N m"),
        Joint("elbow", "rad", "N m"),
    )
    parameters = (
        Parameter("J1", "kg m^2", 1.16, "inertia of the column about its axis"),
        Parameter("m2", "kg", 56.5, "mass of the upper arm"),
        Parameter("x2", "m", 0.172, "centre of the upper arm, beside its axis"),
        Parameter("y2", "m", 0.205, "centre of the upper arm, along it"),
        Parameter("Ixx2", "kg m^2", 2.58, "inertia of the upper arm"),
        Parameter("Iyy2", "kg m^2", 0.64, "inertia of the upper arm"),
        Parameter("Izz2", "kg m^2", 2.73, "inertia of the upper arm"),
        Parameter("Ixy2", "kg m^2", -0.46, "inertia of the upper arm"),
        Parameter("m3", "kg", 26.4, "mass of the elbow"),
        Parameter("x3", "m", 0.064, "centre of the elbow"),
        Parameter("y3", "m", -0.034, "centre of the elbow"),
        Parameter("Ixx3", "kg m^2", 0.279, "inertia of the elbow"),
        Parameter("Iyy3", "kg m^2", 0.245, "inertia of the elbow"),
        Parameter("Izz3", "kg m^2", 0.413, "inertia of the elbow"),
        Parameter("Ixy3", "kg m^2", -0.070, "inertia of the elbow"),
        Parameter("m4", "kg", 28.7, "mass of the forearm"),
        Parameter("Ixx4", "kg m^2", 1.67, "inertia of the forearm across"),
        Parameter("Iyy4", "kg m^2", 0.081, "inertia of the forearm along"),
        Parameter("m5", "kg", 5.2, "mass of the wrist"),
        Parameter("Ixx5", "kg m^2", 1.25, "inertia of the wrist"),
        Parameter("Iyy5", "kg m^2", 0.81, "inertia of the wrist"),
        Parameter("Izz5", "kg m^2", 1.53, "inertia of the wrist"),
        Parameter("m6", "kg", 0.5, "mass of the flange"),
        Parameter("c6", "m", 0.05, "centre of the flange, along each axis"),
        Parameter("load", "kg", 15.0, "mass of the load"),
        Parameter("load_x", "m", 0.1, "place of the load on the flange"),
        Parameter("load_y", "m", 0.25, "place of the load on the flange"),
        Parameter("load_z", "m", 0.1, "place of the load on the flange"),
        Parameter("wrist_4", "rad", 0.0, "angle at which axis 4 is locked"),
        Parameter("wrist_5", "rad", math.radians(-110.0), "angle at which axis 5 is locked"),
        Parameter("height", "m", 0.351, "from the deck to the column's joint"),
        Parameter("y12", "m", 0.324, "from the column's joint to the shoulder"),
        Parameter("z12", "m", 0.3, "from the column's joint to the shoulder"),
        Parameter("upper", "m", 0.65, "length of the upper arm"),
        Parameter("y34", "m", 0.414, "from the elbow to the forearm's joint"),
        Parameter("z34", "m", -0.155, "from the elbow to the forearm's joint"),
        Parameter("y45", "m", 0.186, "from the forearm's joint to the wrist"),
        Parameter("y56", "m", 0.125, "from the wrist to the flange"),
        Parameter("g", "m/s^2", 9.81, "gravity"),
    )
    motor_inertia = (
        Parameter("I1", "kg m^2", 0.0013 * 105**2, "motor of the swivel"),
        Parameter("I2", "kg m^2", 0.0013 * 210**2, "motor of the shoulder"),
        Parameter("I3", "kg m^2", 0.0013 * 60**2, "motor of the elbow"),
    )
    stiffness = (
        Parameter("k1", "N m/rad", 43.0 * 105**2, "gear of the swivel"),
        Parameter("k2", "N m/rad", 8.0 * 210**2, "gear of the shoulder"),
        Parameter("k3", "N m/rad", 58.0 * 60**2, "gear of the elbow"),
    )
    start_position = tuple(math.radians(angle) for angle in (-60.0, 20.0, 90.0))
    reference_offset = start_position
    reference_terms = ((SineTerm(0.3, 1.0),), (SineTerm(0.2, 1.0),), (SineTerm(0.2, 1.5),))
    control_defaults = {"delta": 0.1}
    source = "Türk and Otter 1987; Modelica Standard Library, RobotR3 (BSD 3-clause)."

    def links(self, p):
        quarter = math.pi / 2  # the column turns about y, which is the z of its joint's frame
        upper = [[p.Ixx2, p.Ixy2, 0], [p.Ixy2, p.Iyy2, 0], [0, 0, p.Izz2]]
        mass, centre, inertia = lumped(self.forearm(p))
        return [
            Link("column", "revolute", -1, (0, p.height, 0), (-quarter, 0, 0), inertia=p.J1),
            Link(
                "upper arm",
                "revolute",
                0,
                origin=(0, -p.z12, p.y12),
                rpy=(quarter, 0, 0),
                axis=(1, 0, 0),
                mass=p.m2,
                com=(p.x2, p.y2, 0),
                inertia=upper,
            ),
            Link("elbow", "revolute", 1, (0, p.upper, 0), (0, 0, 0), (1, 0, 0), mass, centre, inertia),
        ]

    def forearm(self, p):
        """What the elbow carries, in its frame, each part as `lumped` wants it."""
        elbow = ca.blockcat([[p.Ixx3, p.Ixy3, 0], [p.Ixy3, p.Iyy3, 0], [0, 0, p.Izz3]])
        r4, R4 = ca.vertcat(0, p.y34, p.z34), about("y", p.wrist_4)
        r5, R5 = r4 + R4 @ ca.vertcat(0, p.y45, 0), R4 @ about("x", p.wrist_5)
        r6 = r5 + R5 @ ca.vertcat(0, p.y56, 0)
        none = ca.SX.zeros(3, 3)
        return [
            (p.m3, ca.vertcat(p.x3, p.y3, 0), elbow),
            (p.m4, r4, R4 @ ca.diag(ca.vertcat(p.Ixx4, p.Iyy4, p.Ixx4)) @ R4.T),
            (p.m5, r5, R5 @ ca.diag(ca.vertcat(p.Ixx5, p.Iyy5, p.Izz5)) @ R5.T),
            (p.m6, r6 + R5 @ (p.c6 * ca.SX.ones(3)), none),
            (p.load, r6 + R5 @ ca.vertcat(p.load_x, p.load_y, p.load_z), none),
        ]
