"""Step in distance that separates the object from its support; a finer one for a flat object on a table."""

from itertools import islice

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.terms.depth.classification.outline_distance import around
from abs_service.tracker.terms.depth.classification.visibility import MAX_STEP_M, surfaces_of

#: Finer steps that are tried [m], down to 3.5 mm. Where noise or a grazing view tears surfaces at them, none will do.
FINER_STEPS_M = tuple(MAX_STEP_M * 2 ** (-k / 2) for k in range(1, 8))

#: A step separates the object if one connected surface has at least this share of the mesh's pixels, and at most this
#: multiple of their number: a mesh ends up to a cell inside the object.
MIN_SHARE, MAX_RATIO = 0.95, 2.0

#: Distance beside the mesh up to which connected pixels are counted, in sides of a square of its area.
REACH = 0.5


def separating_step(distance: NDArray[np.float32], silhouette: NDArray[np.bool_]) -> float:
    """Step between neighbouring pixels [m] above which they show different surfaces, from the first image.

    `MAX_STEP_M` if it separates the object, or if no step does; else the largest step but one that does: in later
    images, noise would connect the object to what it lies on at the largest one.

    Args:
        distance: measured radial distances (height, width) [m], NaN without return.
        silhouette: pixels (height, width) of the mesh.
    """
    if separates(MAX_STEP_M, distance, silhouette):
        return MAX_STEP_M
    finer = (step for step in FINER_STEPS_M if separates(step, distance, silhouette))
    return next(reversed(list(islice(finer, 2))), MAX_STEP_M)


def separates(step: float, distance: NDArray[np.float32], silhouette: NDArray[np.bool_]) -> bool:
    """True if a step [m] separates the surface of a mesh's pixels (rows, columns) from those beside it."""
    if not silhouette.any():
        return False
    pixels = np.count_nonzero(silhouette)
    part = around(silhouette, int(REACH * np.sqrt(pixels)))
    labels = surfaces_of(distance[part], step).labels
    own = np.bincount(labels[silhouette[part]], minlength=2)
    own[0] = 0  # of no surface
    shared, all_of_it = own.max(), np.count_nonzero(labels == own.argmax())
    return bool(shared > MIN_SHARE * pixels and all_of_it < MAX_RATIO * pixels)
