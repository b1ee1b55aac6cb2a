"""The work: one closed-loop run of the reference paper's arm under shake, variable power log law, final state only.

Guo et al. 2023, J. Mar. Sci. Eng. 11(3) 474, with the boundary layer and the limit that springline's scenarios use.
RK4 with a step of 1e-4 s over 4 s: 40,000 steps, 160,000 evaluations of control and plant (continuous control), or
40,000 of the control and 160,000 of the plant (control sampled at every step, zero-order hold). Both are counted as
160,000 evaluations. One parameter, delta, differs from run to run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Control = Literal["continuous", "sampled"]

Runner = Callable[[Floats, int], Floats]
"""run(delta, steps): final states (runs, 8) of one run per entry of delta, after `steps` steps of STEP seconds."""

MODES: tuple[Control, ...] = ("continuous", "sampled")

STEP = 1e-4
STEPS = 40_000
STAGES = 4
QUANTUM = 400
"""The number of steps of a run is a multiple of this: contenders that fold steps into one function fold this many."""

PREFIX = 4_000
"""Steps after which results are compared: with a zero-order hold the loop magnifies rounding errors as it goes on."""

# Linked the usual way, a library of -ffast-math makes the whole process flush denormal numbers to zero, springline too.
FAST_MATH = ("-ffast-math", "-nostartfiles")

# Arm (kg, kg, kg m^2, m, m/s^2), springs (N/m, N m/rad), motors (kg, kg m^2).
M2, M3, J, L3, G = 10.0, 40.0, 40.0 * 0.74**2 / 3.0, 0.74, 9.8
K_LIFT, K_ROTATION, MOTOR_LIFT, MOTOR_ROTATION = 2.0e6, 2.0e4, 2.0, 0.01
# Reaching law, surface, damping of the motors, limit on the law.
K1, K2, K3, ALPHA, EPSILON_LOG, ZETA = 3.0, 5.0, 12.0, 0.5, 10.0, 0.9
MU_LIFT, MU_ROTATION, LAMBDA, DELTA = 12.0, 5.0, 5.0, 0.05
KF_LIFT, KF_ROTATION, A_MAX = 200.0, 2.6, 200.0
# Shake (m, rad/s) and reference sin(pi t), 1 + sin(pi t / 2).
SHAKE_AMPLITUDE, SHAKE_OMEGA = 0.1, 10.0
REFERENCE_OMEGA = math.pi, 0.5 * math.pi

INITIAL_STATE: tuple[float, ...] = (0.8, 0.5, 0.0, 0.0, 0.8, 0.5, 0.0, 0.0)
"""[q1, dq1, q2, dq2]: the paper's, with unloaded springs."""


def deltas(runs: int) -> Floats:
    """The varied parameter of `runs` runs: 0.04 to 0.06, all of them clear of chatter; 0.05 for a single run."""
    return np.linspace(0.04, 0.06, runs) if runs > 1 else np.array([DELTA])


@dataclass(frozen=True, slots=True)
class Contender:
    """One way to do the work.

    name, variant  what it is called in the table; the variant begins with what its ratio refers to: the control mode
                   for whatever does this work
    build          generate, compile, return a Runner: what a user waits for before the first result
    batch          runs that one call takes on
    threads        processor cores that it may use
    modules        packages that it needs besides springline's own
    compiles       whether it has a compiler to wait for (timed with continuous control)
    comparable     whether it does this work, so that its states are compared with springline's
    adaptive       chooses its own steps, so that its time is that of the whole duration, not of so many steps
    tolerance      largest difference of a state from springline's over the compared steps, relative to max(1, |state|)
    """

    name: str
    variant: str
    control: Control
    build: Callable[[], Runner]
    batch: int = 1
    threads: int = 1
    modules: tuple[str, ...] = ()
    compiles: bool = False
    comparable: bool = True
    adaptive: bool = False
    tolerance: float = 1e-9

    @property
    def title(self) -> str:
        """Name, variant and batch: unique. Of contenders that differ in the batch alone, the fastest is shown."""
        return f"{self.name}, {self.variant}, {self.batch} at once"
