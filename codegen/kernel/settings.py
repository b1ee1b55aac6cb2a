"""What the loop is told of a simulation: steps, time, bound, and what its runs are judged by."""

from __future__ import annotations

from dataclasses import dataclass

from springline.codegen.kernel.metrics import BANDS
from springline.codegen.numbers import double, real, whole

MOST_STEPS = 2**53
"""Steps are counted in doubles too, and these hold no more whole numbers without a gap."""


LARGEST_SEED = 2**32 - 1
"""The generator's key has words of 32 bits."""


@dataclass(frozen=True, slots=True)
class LoopSettings:
    """What the loop is told about every run of a batch: steps of h s, bound on |x_i|, sampling, output, thresholds.

    limits  least and greatest q1 of each joint, infinite where there is none; () for a loop that looks at none
    seed    of the noise on what sensors show, 32 bits
    delay   steps from a command to when it arrives, 1 to those of the structure; None for just these

    Raises ValueError, with the name and what was expected, for numbers that the loop cannot count or step with.
    """

    steps: int
    step: float
    bound: float = 1e6
    hold: int = 1
    output_every: int = 0
    response_band: float = 0.10
    settling_band: float = 0.05
    response_error: float = 0.0
    settling_error: float = 0.0
    start_time: float = 0.0
    limits: tuple[tuple[float, float], ...] = ()
    seed: int = 0
    delay: int | None = None

    def __post_init__(self) -> None:
        checked = {
            "steps": whole("steps", self.steps, 0, MOST_STEPS),
            "step": real("step", self.step, positive=True),
            "bound": real("bound", self.bound, positive=True, infinite=True),
            "hold": whole("hold", self.hold, 1, MOST_STEPS),
            "output_every": whole("output_every", self.output_every, 0, MOST_STEPS),
            "response_band": real("response_band", self.response_band),
            "settling_band": real("settling_band", self.settling_band),
            "response_error": real("response_error", self.response_error),
            "settling_error": real("settling_error", self.settling_error),
            "seed": whole("seed", self.seed, 0, LARGEST_SEED),
            "start_time": real("start_time", self.start_time),
        }
        if self.delay is not None:
            checked["delay"] = whole("delay", self.delay, 1, MOST_STEPS)
        for name, value in checked.items():
            object.__setattr__(self, name, value)  # the numbers that were checked, whatever type they came in
        pairs = [tuple(map(double, pair)) for pair in self.limits]
        if not all(len(pair) == 2 and pair[0] < pair[1] for pair in pairs):
            raise ValueError(f"limits are {self.limits!r}, expected a pair low < high for each joint")
        object.__setattr__(self, "limits", tuple(pairs))
        real("end, start_time + steps * step,", self.start_time + self.steps * self.step)

    @property
    def bands(self) -> tuple[float, ...]:
        """What the metrics take for settled, in the order of BANDS."""
        return tuple(getattr(self, name) for name in BANDS)

    @property
    def rows(self) -> int:
        """Trajectory rows of a complete run: k = 0, output_every, ..., and N."""
        if self.output_every == 0:
            return 0
        return self.steps // self.output_every + 1 + (self.steps % self.output_every != 0)
