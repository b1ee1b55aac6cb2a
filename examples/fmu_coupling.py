"""The controller as an FMU, and an arm that springline knows nothing of.

    springline export fmu3 paper/nominal --part controller -o fmu
    python fmu_coupling.py fmu/nominal_controller_fmi3.fmu

The arm is written by hand below: rigid joints, friction, and motors whose force lags behind the command, none of which
the controller's model has. Every millisecond the two exchange measurements and commands: the command is asked for
before the arm moves, so that it is not a step late (docs/fmu.md says what delay costs). Needs fmpy and NumPy; an FMU of
FMI 2.0 does as well.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable, Sequence

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray

Vector = NDArray[np.float64]

SAMPLE, DURATION = 1e-3, 2.5  # s
INNER = 4  # integration steps of the arm per sample


class Arm:
    """State [lift, rotation, their rates, motor force, motor torque]; m, rad, N, N m."""

    m_lift, m_arm, inertia, reach, g = 12.0, 40.0, 29.2, 0.74, 9.8  # inertia: about the hinge
    coulomb, viscous = np.array([15.0, 4.0]), np.array([30.0, 2.0])
    lag = 2e-3  # s

    def __init__(self, position: Sequence[float]) -> None:
        self.state = np.array([*position, 0.0, 0.0, 0.0, 0.0])

    def slope(self, state: Vector, command: Vector) -> Vector:
        theta, rate, force = state[1], state[2:4], state[4:6]
        coupling = self.m_arm * self.reach * np.cos(theta)
        mass = np.array([[self.m_lift + self.m_arm, coupling], [coupling, self.inertia]])
        weight = np.array([(self.m_lift + self.m_arm - 2.0) * self.g, coupling * self.g])
        spin = np.array([-self.m_arm * self.reach * np.sin(theta) * rate[1] ** 2, 0.0])
        friction = self.coulomb * np.tanh(rate / 0.01) + self.viscous * rate
        acceleration = np.linalg.solve(mass, force - weight - spin - friction)
        return np.concatenate([rate, acceleration, (command - force) / self.lag])

    def move(self, command: Vector, duration: float) -> None:
        h = duration / INNER
        for _ in range(INNER):
            middle = self.state + 0.5 * h * self.slope(self.state, command)
            self.state = self.state + h * self.slope(middle, command)


class Controller:
    """The FMU, by the names of its variables."""

    def __init__(self, path: str) -> None:
        description = fmpy.read_model_description(path)
        self.folder = fmpy.extract(path)
        self.two = description.fmiVersion == "2.0"
        self.references = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.fmu = (FMU2Slave if self.two else FMU3Slave)(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="controller",
        )
        self.fmu.instantiate()
        if self.two:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def set(self, names: Iterable[str], values: Iterable[float]) -> None:
        references = [self.references[name] for name in names]
        (self.fmu.setReal if self.two else self.fmu.setFloat64)(references, [float(value) for value in values])

    def get(self, *names: str) -> list[float]:
        references = [self.references[name] for name in names]
        return list((self.fmu.getReal if self.two else self.fmu.getFloat64)(references))

    def step(self, time: float) -> None:
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=SAMPLE)

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder)


def reference(t: float) -> tuple[Vector, Vector, Vector]:
    """Coordinates, rates and accelerations that are wished for."""
    w = np.array([np.pi, np.pi / 2])
    return np.array([0.0, 1.0]) + np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)


def main(path: str) -> float:
    """Run, print, and return the largest error of the last second."""
    joints = ("lift", "rotation")
    names = [f"{quantity}_{joint}" for quantity in ("q1d", "dq1d", "ddq1d", "q1", "dq1", "dq2") for joint in joints]
    arm, controller = Arm((0.8, 0.5)), Controller(path)
    worst = 0.0
    print("t [s]   e_lift [m]   e_rotation [rad]   U_lift [N]   U_rotation [N m]")
    for k in range(round(DURATION / SAMPLE)):
        t = k * SAMPLE
        position, rate = arm.state[:2], arm.state[2:4]  # joints are rigid: the motors move with them
        controller.set(names, np.concatenate([*reference(t), position, rate, rate]))
        command = np.array(controller.get("U_lift", "U_rotation"))
        error = reference(t)[0] - position
        if k % 500 == 0:
            print(f"{t:5.2f}  {error[0]:11.5f}  {error[1]:17.5f}  {command[0]:11.1f}  {command[1]:17.1f}")
        if t >= DURATION - 1.0:
            worst = max(worst, float(np.abs(error).max()))
        arm.move(command, SAMPLE)
        controller.step(t)
    controller.close()
    print(f"largest error in the last second: {worst:.5f}")
    return worst


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
