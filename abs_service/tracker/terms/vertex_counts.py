"""Vertices of a mesh by what one sensor's image shows of them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel


@dataclass(frozen=True, slots=True)
class VertexCounts:
    """Numbers of samples that face a sensor, by what its image shows of them; each is counted once.

    Those without a class are not judged: beside an outline that has a term of its own, or of unknown appearance.

    Attributes:
        facing: all of them; a back that is turned away is not among them.
        agreeing: measured, and explained by noise.
        disagreeing: measured, and not explained by noise: another distance or colour, or the background.
        missing: no return of the sensor where the object should be.
        behind_occluder: something in front of the object hides them.
        behind_itself: the object itself hides them.
        outside: outside the image.
        turned_away: do not face the sensor; none of the others.
    """

    facing: int = 0
    agreeing: int = 0
    disagreeing: int = 0
    missing: int = 0
    behind_occluder: int = 0
    behind_itself: int = 0
    outside: int = 0
    turned_away: int = 0

    @property
    def expected(self) -> int:
        """Number of those that should be in sight: all that are judged, but for what the object itself hides."""
        return self.agreeing + self.disagreeing + self.missing + self.behind_occluder + self.outside

    def share(self, name: str) -> float:
        """Share of a class in those that face the sensor, 0…1."""
        return float(getattr(self, name)) / self.facing if self.facing else 0.0


class VertexMasks(NamedTuple):
    """Masks (n,) of samples by what one sensor's image shows of them.

    Attributes:
        pixel: see `Synthesis`.
        facing: turned towards the sensor.
        missing: over an area without return, or a lost return.
        behind_occluder: something in front of the object hides them; comes before a missing return.
        unjudged: without a class if neither holds.
    """

    pixel: NDArray[np.int32]
    facing: NDArray[np.bool_]
    missing: NDArray[np.bool_]
    behind_occluder: NDArray[np.bool_]
    unjudged: NDArray[np.bool_]

    def tally(
        self, measured: NDArray[np.bool_], residual: NDArray[np.float64], minimum: float
    ) -> tuple["Tally", float]:
        """Numbers of samples, and the sum of the squared residuals of those that agree.

        Args:
            measured: mask (n,) of the samples with a measurement.
            residual: their absolute residuals (n,).
            minimum: residual of a measurement that disagrees.
        """
        counts = np.zeros(len(Tally._fields), np.int64)
        squares = count_samples(self, measured, residual, minimum, counts)
        return Tally(*counts.tolist()), squares


class Tally(NamedTuple):
    """Numbers of samples, each in one of the first six.

    Attributes:
        visible: in the image, and nothing hides them; their measurement may be missing.
        missing, behind_occluder, behind_itself, outside, unjudged: see `VertexCounts`.
        measured, agreeing: of the visible ones.
        samples, inliers: measured and agreeing ones of all.
    """

    visible: int
    missing: int
    behind_occluder: int
    behind_itself: int
    outside: int
    unjudged: int
    measured: int
    agreeing: int
    samples: int
    inliers: int

    @property
    def occluded(self) -> int:
        """Number of samples that something hides, a missing return included."""
        return self.missing + self.behind_occluder + self.behind_itself

    def of(self, samples: int) -> VertexCounts:
        """The counts of so many samples."""
        facing = sum(self[:6])
        return VertexCounts(
            facing=facing,
            agreeing=self.agreeing,
            disagreeing=self.measured - self.agreeing,
            missing=self.missing + self.visible - self.measured,
            behind_occluder=self.behind_occluder,
            behind_itself=self.behind_itself,
            outside=self.outside,
            turned_away=samples - facing,
        )


#: Indices of the fields of a `Tally`.
_VISIBLE, _MISSING, _BEHIND_OCCLUDER, _BEHIND_ITSELF, _OUTSIDE, _UNJUDGED, _MEASURED, _AGREEING, _SAMPLES, _INLIERS = (
    range(len(Tally._fields))
)


@kernel
def count_samples(
    masks: VertexMasks,
    measured: NDArray[np.bool_],
    residual: NDArray[np.float64],
    minimum: float,
    counts: NDArray[np.int64],
) -> float:
    """Adds the numbers of a `Tally` to zeros; the sum of the squared residuals of those that agree."""
    squares = 0.0
    for v in range(masks.pixel.size):
        pixel, agrees = masks.pixel[v], measured[v] and residual[v] < minimum
        counts[_SAMPLES] += 1 if measured[v] else 0
        counts[_INLIERS] += 1 if agrees else 0
        squares += residual[v] * residual[v] if agrees else 0.0
        if pixel <= 0:
            if masks.facing[v]:
                counts[_BEHIND_ITSELF if pixel < 0 else _OUTSIDE] += 1
        elif masks.behind_occluder[v]:
            counts[_BEHIND_OCCLUDER] += 1
        elif masks.missing[v]:
            counts[_MISSING] += 1
        elif masks.unjudged[v]:
            counts[_UNJUDGED] += 1
        else:
            counts[_VISIBLE] += 1
            counts[_MEASURED] += 1 if measured[v] else 0
            counts[_AGREEING] += 1 if agrees else 0
    return squares
