"""Noise of a colour pixel around the colour of the vertex that it shows."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt

LEVELS = 256.0


@dataclass(frozen=True)
class GaussianColor:
    """Every channel deviates independently, with one deviation.

    It covers the camera's noise and, much larger, what sparse synthesis leaves out: interpolation between pixels and
    changes of illumination. That is why it is a number of the rig and not of the data sheet.

    Attributes:
        sigma: standard deviation of a channel, in levels of 256.
    """

    sigma: Annotated[float, Gt(0)] = 15.0

    def build(self) -> "GaussianColor":
        """The model itself: its TOML keys are its fields."""
        return self


Settings = GaussianColor
