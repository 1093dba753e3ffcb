"""Motion of a mesh that the distances of its edges from the outline show: a slide, or a turn."""

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.terms.median import median
from calib.jit import kernel

#: Least number of edges that face one side of the image and are judged together.
MIN_OF_A_SIDE = 8

#: The ends of a strip have fewer; if all of one end inside the object, and all of the other beside it, it has slid.
MIN_OF_AN_END = 2

#: Share of the squared distances from the outline that a motion of the mesh explains at least, if it has moved.
MIN_EXPLAINED = 0.7

#: Its least length: mixed pixels along an outline let all edges of a side err alike [px].
MIN_PX = 2.0

#: Share of its length by which a motion displaces edges across the outline, root mean square, if they can show it: an
#: outline is known to half a pixel, which would be a motion of `MIN_PX`. A slide along a straight side, and a turn of
#: an arc about its centre, show nothing of themselves; a turn of a hexagon shows 0.3.
MIN_SHOWN = 0.25

#: In squares, what is less is rounding.
_SHOWN = 1e-12

#: Turns directions in the image by an eighth, from its corners to its sides.
_EIGHTH = np.sqrt(0.5) * np.array([[1.0, -1.0], [1.0, 1.0]])


def displacement(away: NDArray[np.float64], directions: NDArray[np.float64], beyond: float) -> float:
    """Distance of edges from the outline: the mean of all, or what shows that the mesh has slid if that is larger.

    A slide is seen by the edges across it only: those of one side end inside the object, those of the other beside it.
    Where only one of the two sides is in sight, that side tells it. The median of a side is taken, or of two ends with
    few edges the one that tells least, and both sides must agree, because something may lie against the edges of a
    side. Sides face those of the image or its corners, so that a strip's ends are judged without its long edges.

    Args:
        away: signed distances (k,) of the edges from the outline, −∞ for those outside it by an unknown distance.
        directions: out of the mesh, in the image (k, 2).
        beyond: that unknown distance is at least so long.
    """
    if not away.any():
        return 0.0
    right, down, left, up = sides = by_side(directions)
    lower_right, lower_left, upper_left, upper_right = by_side(directions @ _EIGHTH)
    pairs = ((right, left), (down, up), (lower_right, upper_left), (lower_left, upper_right))
    slides = [_slide(away[one], away[other]) for one, other in pairs]
    alone = [_alone(away[one], away[other]) for one, other in zip(sides, sides[[2, 3, 0, 1]], strict=True)]
    mean = float(np.mean(np.abs(np.maximum(away, -beyond))))
    return max(mean, *(slide if np.isfinite(slide) else beyond for slide in (*slides, *alone)))


def motion(away: NDArray[np.float64], directions: NDArray[np.float64], places: NDArray[np.float64]) -> float:
    """Slide and turn of the mesh in the image that explain the distances of its edges from the outline: their median.

    A turn leaves half of every side inside the object and half beside it, which neither mean nor sides tell. It counts
    if it explains most of the squared distances: what lies against one side, or a bend, does not look like a motion.
    Of all motions, only those are looked for that the edges in sight can show, see `MIN_SHOWN`.

    Args:
        away: signed distances (k,) of the edges from the outline [px].
        directions: unit ones out of the mesh, in the image (k, 2).
        places: of the edges in the image (k, 2) [px].

    Returns:
        Length of the motion of an edge [px]; 0 if there is none or too few edges tell.
    """
    if len(away) < MIN_OF_A_SIDE or not away.any():
        return 0.0
    arms, (along, across, turn), explained = _fitted(away, directions, places, MIN_SHOWN**2 * len(away))
    if explained <= MIN_EXPLAINED * (away @ away):
        return 0.0
    x, y = arms.T
    length = median(np.hypot(along - turn * y, across + turn * x))
    return length if length > MIN_PX else 0.0


def without_motion(
    away: NDArray[np.float64], directions: NDArray[np.float64], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The rest (k,) of the distances of edges from the outline that no slide and turn of the mesh explain [px].

    Args:
        away, directions, places: as in `motion`; at least `MIN_OF_A_SIDE`.
    """
    arms, (along, across, turn), _ = _fitted(away, directions, places, _SHOWN * len(away))
    right, down = directions.T
    return away - right * (along - turn * arms[:, 1]) - down * (across + turn * arms[:, 0])


def _fitted(
    away: NDArray[np.float64], directions: NDArray[np.float64], places: NDArray[np.float64], minimum: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """The motion (3,) of `shown_by` that explains the distances of edges (k,) best, by least squares.

    Of the motions that displace the edges across the outline by at least so much, the sum of their squares. With it go
    the arms (k, 2) of the edges about their centre, 1 on average, and the sum of the squares that it explains.
    """
    equations, arms = np.zeros((4, 4)), np.empty_like(places)
    add_equations(away, directions, places, equations, arms)
    squares, motions, _ = scipy.linalg.lapack.dsyev(equations[:3, :3])  # a third of the time of NumPy's
    shown = squares >= minimum
    squares, motions = squares[shown], motions[:, shown]
    parts = equations[3, :3] @ motions
    return arms, motions @ (parts / squares), float(parts @ (parts / squares))


@kernel
def add_equations(
    away: NDArray[np.float64],
    directions: NDArray[np.float64],
    places: NDArray[np.float64],
    equations: NDArray[np.float64],
    arms: NDArray[np.float64],
) -> None:
    """Adds up the squares (4, 4) of the rows of `shown_by` and the distances, side by side; writes the arms (k, 2)."""
    count, x, y, square, row = places.shape[0], 0.0, 0.0, 0.0, np.empty(4)
    for k in range(count):
        x, y = x + places[k, 0] / count, y + places[k, 1] / count
    for k in range(count):
        arms[k, 0], arms[k, 1] = places[k, 0] - x, places[k, 1] - y
        square += (arms[k, 0] * arms[k, 0] + arms[k, 1] * arms[k, 1]) / count
    scale = 1 / np.sqrt(max(square, 1e-300))
    for k in range(count):
        arms[k, 0], arms[k, 1] = arms[k, 0] * scale, arms[k, 1] * scale
        right, down = directions[k, 0], directions[k, 1]
        row[0], row[1], row[2], row[3] = right, down, down * arms[k, 0] - right * arms[k, 1], away[k]
        for i in range(4):
            for j in range(4):
                equations[i, j] += row[i] * row[j]


def shown_by(directions: NDArray[np.float64], arms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement of edges across the outline (k, 3), by a slide along the columns, one along the rows, and a turn.

    Args:
        directions: unit ones across the outline (k, 2).
        arms: of the edges about the centre of the turn (k, 2).
    """
    right, down = directions.T
    return np.stack([right, down, down * arms[:, 0] - right * arms[:, 1]], axis=1)


def _slide(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Slide that the distances of two opposite sides show, infinite if nothing tells how far; 0 if they disagree."""
    few = max(len(one), len(other)) < MIN_OF_A_SIDE
    if min(len(one), len(other)) < (MIN_OF_AN_END if few else MIN_OF_A_SIDE):
        return 0.0
    (least, most), (other_least, other_most) = (
        (float(side.min()), float(side.max())) if few else (median(side), median(side)) for side in (one, other)
    )
    return max(0.0, min(least, -other_most), min(-most, other_least))


def _alone(side: NDArray[np.float64], opposite: NDArray[np.float64]) -> float:
    """Slide that one side shows, infinite if nothing tells how far; 0 if the opposite one tells as well."""
    return abs(median(side)) if len(side) >= MIN_OF_A_SIDE > len(opposite) else 0.0


def by_side(directions: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Masks (4, k) of image directions (k, 2) that are nearest to right, down, left and up; unknown ones are none."""
    sides = np.zeros((4, len(directions)), np.bool_)
    _mark_sides(directions, sides)
    return sides


@kernel
def _mark_sides(directions: NDArray[np.float64], sides: NDArray[np.bool_]) -> None:
    """See `by_side`, into False."""
    for k in range(directions.shape[0]):
        angle = np.arctan2(directions[k, 1], directions[k, 0])
        if not np.isnan(angle):
            # A whole turn more, so that integers cut to the quarter below.
            sides[int(angle * (2 / np.pi) + 4.5) % 4, k] = True
