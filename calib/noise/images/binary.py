"""Binary sensor: error rates of a light barrier that is interrupted or free."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import ArrayLike, NDArray

from calib.noise.base import NoiseError

Rate = Annotated[float, Interval(gt=0, lt=0.5)]


@dataclass(frozen=True)
class LightBarrier:
    """Beam from the sensor's centre along its z axis, with the error rates of its receiver.

    Attributes:
        length_m: length of the beam, from the lamp to the receiver [m].
        miss: probability that an interrupted beam is reported as free.
        false_alarm: probability that a free beam is reported as interrupted, including interruption by other objects.
    """

    length_m: Annotated[float, Gt(0)]
    miss: Rate = 0.01
    false_alarm: Rate = 0.01

    @property
    def uniform(self) -> float:
        """Negative log-probability of an outlier: uniform over both readings."""
        return float(np.log(2))

    def cost(self, interrupted: bool) -> tuple[float, float]:
        """Negative log-probability of a reading, for a mesh that leaves the beam free and for one that crosses it."""
        free = self.false_alarm if interrupted else 1 - self.false_alarm
        crossing = 1 - self.miss if interrupted else self.miss
        return -float(np.log(free)), -float(np.log(crossing))

    def build(self) -> "LightBarrier":
        """The model itself: its TOML keys are its fields."""
        return self


Settings = LightBarrier


def fit(interrupted: ArrayLike, crossing: ArrayLike, length_m: float) -> LightBarrier:
    """Error rates from readings with known truth: posterior means under Jeffreys' prior.

    Zero observed errors in n readings give the rate 1 / (2 (n + 1)), so that no reading is impossible.

    Args:
        interrupted: readings (n,), boolean.
        crossing: True where the object crossed the beam (n,).
        length_m: from the lamp to the receiver [m].

    Raises:
        NoiseError: the beam was always or never free, or an error rate is 0.5 or more.
    """
    readings, crosses = np.asarray(interrupted, np.bool_), np.asarray(crossing, np.bool_)
    miss = _rate("miss", ~readings[crosses], "crossed by the object")
    return LightBarrier(length_m, miss, _rate("false_alarm", readings[~crosses], "free"))


def _rate(name: str, errors: NDArray[np.bool_], state: str) -> float:
    if not errors.size:
        raise NoiseError(f"{name} is unknown: the beam was never {state}")
    rate = (np.count_nonzero(errors) + 0.5) / (errors.size + 1)
    if rate >= 0.5:
        raise NoiseError(f"{name} is {rate:.2f}, but must be less than 0.5: the readings say the opposite, or nothing")
    return rate
