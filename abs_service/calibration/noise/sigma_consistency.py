"""How well the deviation that a sensor claims for every pixel agrees with what it measures."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.shots.sequences import Sequence
from calib.noise.fit.fitting import MAD_TO_SIGMA
from calib.sequences import local


@dataclass(frozen=True, slots=True)
class Claim:
    """Residuals from local planes over the claimed deviation.

    Attributes:
        name: of what was looked at, for people.
        pixels: that have a local plane and a claim.
        within_one, within_95: share within 1 and 1.96 claimed deviations; 0.683 and 0.95 if the claim is right.
        ratio: robust deviation of the residuals over the claimed one; 1 if the claim is right.
    """

    name: str
    pixels: int
    within_one: float
    within_95: float
    ratio: float


def of_values(name: str, z: NDArray[np.floating]) -> Claim:
    """The claim that residuals over deviations amount to; NaN does not count."""
    size = np.abs(z[np.isfinite(z)])
    if not size.size:
        return Claim(name, 0, np.nan, np.nan, np.nan)
    ratio = MAD_TO_SIGMA * float(np.median(size))
    return Claim(name, size.size, float(np.mean(size < 1)), float(np.mean(size < 1.959964)), ratio)


def of_sequence(sequence: Sequence) -> tuple[Claim, ...]:
    """That of a sequence's first frame, which has a noise that no mean has taken away; none without claims."""
    if not np.isfinite(sequence.claimed).any():
        return ()
    distance = sequence.lengths[0] * sequence.along
    return (of_values(sequence.name, local.normalized(distance, sequence.claimed, sequence.camera.rays())),)
