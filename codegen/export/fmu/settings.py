"""What an FMU is told about time: the scenario's steps, samples and duration."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

FmiVersion = Literal[2, 3]


@dataclass(frozen=True, slots=True)
class Settings:
    """Times of an FMU.

    duration  of the default experiment, s
    step      of the plant's integrator, s
    period    sample period of the control, a whole number of steps, s; 0 for continuous control
    bound     largest |x_i| of the plant and |z_i| of the controller, SI units
    limits    least and greatest q1 of each joint, which the plant may not pass; () for none
    until     where the scenario's signals end, s
    seed, run  what the noise of sensors goes by
    """

    duration: float
    step: float
    period: float = 0.0
    bound: float = 1e6
    until: float = math.inf
    limits: tuple[tuple[float, float], ...] = ()
    seed: int = 0
    run: int = 0

    @property
    def hold(self) -> int:
        """Steps per sample of the control, 0 where it is continuous."""
        return round(self.period / self.step)

    @property
    def sample(self) -> float:
        """What a controller's states are moved on by, s: as the loop counts it, whole steps."""
        return max(self.hold, 1) * self.step
