"""Numbers of vertices and control points that the first image resolves, for keys that are not given (decision 0029)."""

from collections.abc import Iterable
from typing import Literal

import numpy as np
import scipy  # its parts are imported when they are first used

#: Approximate number of vertices of a mesh; "auto": the default number, fewer if the object has fewer pixels.
Vertices = Literal["auto"] | int

#: Default number of vertices; that of a template's mesh, which is made before the object is seen.
TYPICAL_VERTICES = 300

#: A coarser grid loses too much of a small object at its rim.
MIN_VERTICES = 100

#: Largest number of knot spans along the long side, and their number if the sensor's noise is unknown. The time of a
#: frame grows with the square of Θ's dimension; a fourth span gained nothing where noise allows for one.
MAX_SPANS = 3

#: Minimum number of cells of the mesh's grid in a span; fewer vertices do not determine its control points.
MIN_CELLS = 3.0

#: Degree of splines with a continuous curvature.
CUBIC = 3


def vertices(pixels: int) -> int:
    """Number of vertices for an object of so many pixels in the first depth image: never more than it has pixels."""
    return min(TYPICAL_VERTICES, max(pixels, MIN_VERTICES))


def degree(cells: Iterable[float]) -> int:
    """Degree of the splines for a mesh with so many cells along its sides.

    A cubic spline has four control points or more along a side, which three cells and their four vertices determine;
    with fewer, it is quadratic.
    """
    return CUBIC if min(cells) >= MIN_CELLS else CUBIC - 1


def spans(
    sides_m: tuple[float, float],
    cells: tuple[float, float],
    measurements: int,
    deviation_m: float,
    bend_rad: float,
    degree: int,
) -> tuple[int, int]:
    """Numbers of knot spans along the two sides of an object, as many per length on both.

    On the longer side, there are as many as make the mean square error of a frame least: that of the best spline for
    the bend, plus that of control points that are fitted to noise. The mesh limits them on both sides.

    Args:
        sides_m: lengths of the object's sides [m].
        cells: numbers of the mesh's cells along them.
        measurements: their number in a frame: a vertex has one.
        deviation_m: standard deviation of a measurement [m]; 0 if unknown.
        bend_rad: angle between the normals of the two ends of the longer side that the surface can follow [rad].
        degree: of the splines.
    """
    longest = max(sides_m)

    def on_sides(spans: int) -> tuple[int, int]:
        first, second = (max(round(spans * side / longest), 1) for side in sides_m)
        return first, second

    def square_error(spans: int) -> float:
        first, second = on_sides(spans)
        noise = deviation_m**2 * (first + degree) * (second + degree) / measurements
        return spline_error(longest, bend_rad, spans, degree) ** 2 + noise

    best = min(range(1, MAX_SPANS + 1), key=square_error) if deviation_m > 0 else MAX_SPANS
    first, second = (
        min(wanted, max(int(count / MIN_CELLS), 1)) for wanted, count in zip(on_sides(best), cells, strict=True)
    )
    return first, second


def spline_error(length_m: float, bend_rad: float, spans: int, degree: int) -> float:
    """Root mean square distance of the best spline from an arc [m].

    With knots at intervals h = L / spans, the error of the best spline of degree d is the derivative of order d + 1
    times hᵈ⁺¹ √(|B₂ₘ| / (2 m)!), m = d + 1, with Bernoulli's numbers B (de Boor, A Practical Guide to Splines). Of an
    arc by the angle φ, that derivative is (φ / L)ᵈ.
    """
    order = degree + 1
    bernoulli = abs(float(scipy.special.bernoulli(2 * order)[-1]))
    constant = np.sqrt(bernoulli / scipy.special.factorial(2 * order))
    return float(constant * (length_m / spans) ** order * (bend_rad / length_m) ** degree)
