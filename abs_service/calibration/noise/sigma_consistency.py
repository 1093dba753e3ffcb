"""Consistency of the σ that a sensor reports for every pixel with its measurements."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.shots.sequences import Sequence
from calib.noise.fit.fitting import MAD_TO_SIGMA
from calib.sequences import plane_residuals


@dataclass(frozen=True, slots=True)
class SigmaConsistency:
    """Residuals from local planes, normalised by the reported σ.

    Attributes:
        name: label for display.
        pixels: number of pixels with a local plane and a reported σ.
        within_one, within_95: fraction within 1 and 1.96 reported σ; 0.683 and 0.95 if consistent.
        ratio: robust deviation of the residuals over the reported σ; 1 if consistent.
    """

    name: str
    pixels: int
    within_one: float
    within_95: float
    ratio: float


def of_values(name: str, z: NDArray[np.floating]) -> SigmaConsistency:
    """Consistency from normalised residuals; NaN is ignored."""
    size = np.abs(z[np.isfinite(z)])
    if not size.size:
        return SigmaConsistency(name, 0, np.nan, np.nan, np.nan)
    ratio = MAD_TO_SIGMA * float(np.median(size))
    return SigmaConsistency(name, size.size, float(np.mean(size < 1)), float(np.mean(size < 1.959964)), ratio)


def of_sequence(sequence: Sequence) -> tuple[SigmaConsistency, ...]:
    """Consistency of a sequence's first frame, which is not averaged; none without reported σ."""
    if not np.isfinite(sequence.reported_sigma).any():
        return ()
    distance = sequence.lengths[0] * sequence.along
    return (
        of_values(sequence.name, plane_residuals.normalized(distance, sequence.reported_sigma, sequence.camera.rays())),
    )
