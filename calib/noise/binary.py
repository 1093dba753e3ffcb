"""Errors of a sensor that says yes or no: a light barrier that is interrupted or free."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

Rate = Annotated[float, Interval(gt=0, lt=0.5)]


@dataclass(frozen=True)
class LightBarrier:
    """A beam from the sensor's centre along its z axis, and how often its receiver errs.

    Attributes:
        length_m: from the lamp to the receiver [m].
        miss: probability that an interrupted beam is reported as free.
        false_alarm: probability that a free beam is reported as interrupted, by whatever is not the object as well.
    """

    length_m: Annotated[float, Gt(0)]
    miss: Rate = 0.01
    false_alarm: Rate = 0.01

    @property
    def uniform(self) -> float:
        """Negative log-probability of a reading that says nothing about the surface."""
        return float(np.log(2))

    def cost(self, interrupted: bool) -> tuple[float, float]:
        """−log P of a reading, for a mesh that leaves the beam free and for one that crosses it."""
        free = self.false_alarm if interrupted else 1 - self.false_alarm
        crossing = 1 - self.miss if interrupted else self.miss
        return -float(np.log(free)), -float(np.log(crossing))

    def build(self) -> "LightBarrier":
        """The model itself: its TOML keys are its fields."""
        return self


Settings = LightBarrier
