"""Priors of stretch and motion: negative log-densities of theta, without hand-tuned weights."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt


@dataclass(frozen=True)
class Settings:
    """TOML keys of the priors.

    Attributes:
        stretch: standard deviation of an edge's relative change of length. Paper: 0.01; rubber: 0.2.
        speed: largest standard deviation of a parameter's rate of change around the predicted one, expressed as the
            speed of the surface that it moves [m/s]; it becomes smaller while the object moves as predicted.
        minimum_speed: smallest standard deviation of that rate, while the object moves as predicted [m/s].
        memory_s: time constant of the exponential decay of the predicted velocity [s].
    """

    stretch: Annotated[float, Gt(0)] = 0.01
    speed: Annotated[float, Gt(0)] = 0.3
    minimum_speed: Annotated[float, Gt(0)] = 0.02
    memory_s: Annotated[float, Gt(0)] = 0.1

    def persistence(self, elapsed_s: float) -> float:
        """Share of a velocity that is left after a time [s], 0…1."""
        return float(np.exp(-elapsed_s / self.memory_s))

    def limited(self, speed: float) -> float:
        """A deviation of the rate of change [m/s] within its bounds."""
        return float(np.clip(speed, self.minimum_speed, self.speed))
