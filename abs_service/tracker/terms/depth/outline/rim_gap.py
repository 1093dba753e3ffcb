"""Gap between the outermost vertices of a mesh and the end of its object, exactly.

Gradients of distances from an outline of pixels are up to 20° off. On the way of a cell that is one to five pixels, to
either side, edge by edge. Edges that do not lie on the outline at first pull at the mesh for ever: their sum is zero
where the mesh was, not where it is, and as outliers of a bounded cost they make minima beside the right one.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.terms.depth.outline.rim import Look
from abs_service.tracker.terms.depth.outline.rim_classes import MAX_GAP_STEPS, MAX_MISS_PX
from calib.camera import Camera

#: Steps of Newton's method, the share of a step outwards over which its slope is taken, and the least slope: an outline
#: that is met at a smaller angle than 17° is not looked for along the edge.
REFINEMENTS, _NEARBY, _MIN_SLOPE = 5, 0.1, 0.3


def exact_gap(
    camera: Camera,
    outer: NDArray[np.float64],
    step: NDArray[np.float64],
    gap: NDArray[np.floating],
    look: Look,
) -> NDArray[np.float32]:
    """Gaps (k,) at which the extrapolated edges outer + gap · step lie on the outline, from nearly right ones (k,).

    Args:
        camera: the depth camera.
        outer, step: outermost vertices and steps outwards, each (k, 3) [m].
        gap: a first guess (k,) [steps]; kept where it is 0, and where nothing nearer to the outline is found.
        look: reads the outline.
    """
    begun, (best, least) = gap > 0, (gap, np.full(len(gap), np.inf))
    for _ in range(REFINEMENTS):
        ends = outer + gap[:, None] * step
        place = camera.project(ends)
        inside, gradients = look(place)
        nearer = np.abs(inside) < least
        best, least = np.where(nearer, gap, best), np.where(nearer, np.abs(inside), least)
        step_px = (camera.project(ends + _NEARBY * step) - place) / _NEARBY
        length = np.linalg.norm(step_px, axis=1)
        slope = np.maximum(-np.vecdot(gradients, step_px), _MIN_SLOPE * length)
        known = begun & (np.abs(inside) < 2 * MAX_MISS_PX) & (slope > 0)
        gap = np.clip(gap + np.divide(inside, slope, out=np.zeros(len(gap)), where=known), 0.0, MAX_GAP_STEPS)
    return best.astype(np.float32)
