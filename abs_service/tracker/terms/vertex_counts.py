"""Vertices of a mesh by what one sensor's image shows of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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


@dataclass(frozen=True, slots=True, eq=False)
class VertexMasks:
    """Masks (n,) of samples, without those that are turned away; no sample is in two.

    Attributes:
        visible: in the image, and nothing hides them; their measurement may be missing.
        missing: over an area without return, or a lost return.
        behind_occluder, behind_itself, outside, unjudged: see `VertexCounts`.
    """

    visible: NDArray[np.bool_]
    missing: NDArray[np.bool_]
    behind_occluder: NDArray[np.bool_]
    behind_itself: NDArray[np.bool_]
    outside: NDArray[np.bool_]
    unjudged: NDArray[np.bool_]

    @classmethod
    def of(
        cls,
        pixel: NDArray[np.int32],
        facing: NDArray[np.bool_],
        missing: NDArray[np.bool_],
        behind_occluder: NDArray[np.bool_],
        unjudged: NDArray[np.bool_],
    ) -> "VertexMasks":
        """Masks of samples at pixels (n,), see `Synthesis`; an occluder comes before a missing return."""
        inside = pixel > 0
        covered, lost = inside & behind_occluder, inside & missing & ~behind_occluder
        unknown = inside & unjudged & ~(covered | lost)
        visible = inside & ~(covered | lost | unknown)
        return cls(visible, lost, covered, (pixel < 0) & facing, (pixel == 0) & facing, unknown)

    @property
    def occluded(self) -> int:
        """Number of samples that something hides, a missing return included."""
        return sum(map(_count, (self.missing, self.behind_occluder, self.behind_itself)))

    def count(self, measured: NDArray[np.bool_], agreeing: NDArray[np.bool_]) -> VertexCounts:
        """Numbers of samples, by masks (n,) of those that are measured and those that agree."""
        visible, missing, outside, unjudged, covered, behind = map(
            _count,
            (self.visible, self.missing, self.outside, self.unjudged, self.behind_occluder, self.behind_itself),
        )
        known, good = _count(self.visible & measured), _count(self.visible & agreeing)
        facing = visible + missing + covered + behind + outside + unjudged
        return VertexCounts(
            facing=facing,
            agreeing=good,
            disagreeing=known - good,
            missing=missing + visible - known,
            behind_occluder=covered,
            behind_itself=behind,
            outside=outside,
            turned_away=len(self.visible) - facing,
        )


def _count(mask: NDArray[np.bool_]) -> int:
    return int(np.count_nonzero(mask))
