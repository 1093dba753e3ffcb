"""Search for the outline of an object beside its mesh: free edges are moved in the image until they lie on it.

The cost of an outline is bounded, so edges farther away than `rim_cost.MAX_DEVIATIONS` deviations do not feel it. A
mesh whose object moves faster than was predicted would end where some edges are held by other parts of the outline. So
a slide and a turn of all edges in the image are looked for first, as in iterative closest points (P. Besl, N. McKay: A
method for registration of 3-D shapes. IEEE Transactions on Pattern Analysis and Machine Intelligence 14, 1992).
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.terms.depth.outline.rim import Look
from abs_service.tracker.terms.depth.outline.rim_motion import MIN_EXPLAINED, MIN_OF_A_SIDE, MIN_SHOWN, shown_by
from abs_service.tracker.terms.median import median
from abs_service.tracker.terms.places.patches import NEAR_PX

#: Number of steps of the registration.
STEPS = 12

#: Largest distance from an edge at which the outline is looked for [px].
REACH_PX = 50.0

#: An edge belongs to a part of the outline that faces as it does: smallest cosine between the two.
_FACING = 0.5

#: Least share of the edges near the outline at the end, and their largest median distance from it [px].
_KNOWN, _ON_PX = 0.7, 1.5

#: Residual of the registration from which on its weight falls [px].
_ROBUST_PX = 2.0


def shift_to_outline(look: Look, places: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shifts (k, 2) [px] by a slide and a turn that lay edges on the outline; zeros where none does.

    Args:
        look: reads the outline.
        places: of the edges in the image (k, 2) [px].
        directions: unit ones out of the mesh, in the image (k, 2).
    """
    still = np.zeros_like(places)
    values, facing = _read(look, places, directions)
    if np.count_nonzero(np.abs(values[facing]) >= NEAR_PX) < MIN_OF_A_SIDE:
        return still
    arms = places - places.mean(axis=0)
    arms /= max(float(np.sqrt(np.mean(arms**2) * 2)), np.finfo(float).tiny)
    moved, shift = np.zeros(3), still
    for _ in range(STEPS):
        if np.count_nonzero(facing) < MIN_OF_A_SIDE:
            return still
        moved = moved + _step(values[facing], directions[facing], arms[facing])
        shift = moved[:2] + moved[2] * np.stack([-arms[:, 1], arms[:, 0]], axis=1)
        values, facing = _read(look, places + shift, directions)
    on = np.count_nonzero(facing) >= _KNOWN * len(places) and median(np.abs(values[facing])) < _ON_PX
    return shift if on and _explains(look, places, values, facing, directions) else still


def _read(
    look: Look, places: NDArray[np.float64], directions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Distances (k,) of edges inside the outline [px], and which of them belong to the part that is nearest."""
    values, gradients = look(places)
    outwards = -np.vecdot(gradients, directions)
    lengths = np.sqrt(np.vecdot(gradients, gradients))
    return values, (np.abs(values) < REACH_PX) & (outwards > _FACING * lengths) & (lengths > 0)


def _step(
    values: NDArray[np.float64], directions: NDArray[np.float64], arms: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Slide and turn (3,) that move edges outwards by their distances (k,) inside the outline, as far as these show."""
    rows = shown_by(directions, arms)
    weights = np.sqrt(np.minimum(1.0, _ROBUST_PX / np.maximum(np.abs(values), _ROBUST_PX)))
    shown_as, sizes, motions = np.linalg.svd(rows * weights[:, None], full_matrices=False)
    parts = ((values * weights) @ shown_as)[sizes >= MIN_SHOWN * np.linalg.norm(weights)]
    return (parts / sizes[: len(parts)]) @ motions[: len(parts)]


def _explains(
    look: Look,
    places: NDArray[np.float64],
    values: NDArray[np.float64],
    facing: NDArray[np.bool_],
    directions: NDArray[np.float64],
) -> bool:
    """True if the edges are off the outline by much less than before, of those whose distance was known then."""
    before, known = _read(look, places, directions)
    both = known & facing
    return bool(values[both] @ values[both] < (1 - MIN_EXPLAINED) * (before[both] @ before[both]))
