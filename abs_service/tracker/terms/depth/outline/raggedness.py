"""Raggedness of an outline: how far its edges in the depth images wander about those of the mesh.

Stereo cameras extend near things by some pixels, differently from place to place and from image to image; flickering
pixels along an edge do the same. Such an outline is known less well than one of a sensor that resolves edges, and tells
less of the mesh. What the edges are off the outline of the predicted mesh is compared, less the slide and turn of the
mesh that explain most of it.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.terms.depth.outline.rim_motion import MIN_OF_A_SIDE, without_motion
from abs_service.tracker.terms.image_noise import NORMAL_MEDIAN
from abs_service.tracker.terms.median import median

#: Weight of a new frame in the running mean square.
NEW = 0.1

#: Largest distance from the outline of edges that are compared; farther ones are off it for other reasons.
LIMIT_PX = 8.0

#: So ragged are outlines of sensors that resolve edges: real ones of structured light 1.0 to 1.4 px about a predicted
#: mesh [px].
TYPICAL_PX = 1.5

#: Share of the raggedness beyond the typical one that is added to the deviation. The edges of a side wander to either
#: side, and less of it is left in their mean; with half of it, a print in colour let a sheet slide to the wrong place
#: in single frames of fast motion (docs/explanation/visibility.md).
SHARE = 1 / 3

#: Distance from the outline beyond which an edge is off it, as a multiple of the outline's raggedness.
OFF = 2.0


class Raggedness:
    """Raggedness of one outline over time.

    Args:
        minimum: deviation of an outline that is not ragged [px].
        maximum: largest deviation [px]; no more than `minimum` for a deviation that does not change.

    Attributes:
        deviation: of the outline [px].
        off_px: an edge that is farther from the outline may be off it for another reason [px]; 0 if unknown.
    """

    def __init__(self, minimum: float, maximum: float):
        self._minimum, self._maximum = minimum, maximum
        self._square = minimum**2
        self.deviation, self.off_px = minimum, 0.0

    def update(self, away: NDArray[np.float64], directions: NDArray[np.float64], places: NDArray[np.float64]) -> None:
        """Takes another frame in; one with too few edges, or with most of them elsewhere, changes nothing.

        Args:
            away: distances (k,) of the predicted edges from the outline [px], NaN where unknown.
            directions: unit ones out of the mesh, in the image (k, 2).
            places: of the edges in the image (k, 2) [px].
        """
        known = (~np.isnan(away)).nonzero()[0]
        near = np.count_nonzero(np.abs(away[known]) < LIMIT_PX)
        if self._maximum <= self._minimum or near < max(MIN_OF_A_SIDE, len(known) / 2):
            return
        left = without_motion(np.clip(away[known], -LIMIT_PX, LIMIT_PX), directions[known], places[known])
        scatter = median(np.abs(left)) / NORMAL_MEDIAN
        self._square += NEW * (scatter**2 - self._square)
        beyond = SHARE**2 * max(self._square - TYPICAL_PX**2, 0.0)
        self.deviation = float(min(np.sqrt(self._minimum**2 + beyond), self._maximum))
        self.off_px = OFF * float(np.sqrt(self._square))
