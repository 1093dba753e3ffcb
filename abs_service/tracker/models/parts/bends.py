"""Bends of the FlexPad model: circular arcs on each side of a line through the sheet's centre, in four directions."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial
from numpy.typing import NDArray

from abs_service.tracker.models.base import ModelError
from abs_service.tracker.models.parts.arc import end_of
from calib.jit import kernel

#: Angles [rad] of the directions along which the sheet bends, from its x axis towards its y axis.
ANGLES = np.deg2rad([0.0, 45.0, 90.0, 135.0])

#: In-plane unit vectors (8, 2) that point away from the centre: both sides of every direction, the positive one first.
SIDES = (
    np.stack([[np.cos(ANGLES), np.sin(ANGLES)], [-np.cos(ANGLES), -np.sin(ANGLES)]]).transpose(2, 0, 1).reshape(8, 2)
)

#: Largest parameter of a bend: full bend towards (+) or away from (−) the sensor.
FULL = 2.0

#: Maximum number of turns of a rolled-up sheet, and degree of the polynomials that approximate it with an error below
#: 1e-7 of the distance from the centre. Few, because each degree is compiled separately, which takes seconds when a
#: sheet of that size is first detected. Beyond the last, single precision loses too many digits.
DEGREES = {1 / 3: 4, 2 / 3: 6, 4 / 3: 10, 3.0: 16}


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Polynomials for sin t / t and (1 − cos t)/t², even functions, in the variable u = scale · t² − 1 from −1 to 1.

    Attributes:
        coefficients: of both (2, degree + 1), in descending powers.
        scale: factor of t².
    """

    coefficients: NDArray[np.float32]
    scale: float


def fit(reach: float, minimum_radius: float) -> Series:
    """Polynomials that interpolate both functions over the range of possible bends.

    Args:
        reach: largest distance of a vertex from the centre [m].
        minimum_radius: radius at a parameter of `FULL` [m].

    Raises:
        ModelError: the sheet would roll up by too many turns.
    """
    turns = reach / minimum_radius / (2 * np.pi)
    limit = next((limit for limit in DEGREES if turns <= limit), None)
    if limit is None:
        maximum = max(DEGREES)
        raise ModelError(
            f"minimum_radius_m = {minimum_radius:g} would roll up a sheet that reaches {reach:.3g} m from its centre "
            f"by {turns:.1f} turns; {maximum:g} are allowed, so minimum_radius_m must be at least "
            f"{_above(reach, maximum):g}"
        )
    largest = 2 * np.pi * limit
    powers = [
        Chebyshev.interpolate(lambda u, f=f: f(largest * np.sqrt((1 + u) / 2)), DEGREES[limit]).convert(kind=Polynomial)
        for f in (_sine, _versine)
    ]
    highest_first = np.array([series.coef[::-1] for series in powers], np.float32)
    return Series(highest_first, 2 / largest**2)


def _above(reach: float, turns: float) -> float:
    """Smallest allowed radius [m], rounded up to 1 mm."""
    return np.ceil(1e3 * reach / (2 * np.pi * turns)) / 1e3


def _sine(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sin t / t; numpy.sinc(x) is sin(πx)/πx."""
    return np.sinc(t / np.pi)


def _versine(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Versine over t², (1 − cos t)/t²."""
    return 0.5 * np.sinc(t / (2 * np.pi)) ** 2


@kernel
def bend(theta: NDArray[np.float64], direction: int, per_bend: float) -> tuple[np.float32, np.float32]:
    """Mean of the curvatures on both sides of a direction, and half their difference [1/m].

    With p the signed distance along the direction, mean · p + difference · |p| is κp on either side. A branch would be
    compiled into a selection in double precision for every vertex.

    Args:
        theta: parameters (15,).
        direction: 0 to 3.
        per_bend: curvature at a parameter of 1 [1/m].
    """
    ahead = min(max(theta[2 * direction], -FULL), FULL) * (0.5 * per_bend)
    behind = min(max(theta[2 * direction + 1], -FULL), FULL) * (0.5 * per_bend)
    return np.float32(ahead + behind), np.float32(ahead - behind)


#: Number of polynomial coefficients; a compile-time constant, so that loops over them are unrolled.
ORDERS = 5


@kernel
def roll(
    p: np.float32,
    kappa: tuple[np.float32, np.float32],
    series: NDArray[np.float32],
    scale: float,
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Displacement of a vertex by the bends of a direction: with t = κp, to sin(t)/κ along it, (1 − cos t)/κ in height.

    A vertex lies on one side only; the sign of the side cancels.

    Args:
        p: signed distance from the centre along the direction [m].
        kappa: mean and half difference of the curvatures, see `bend`.
        series, scale: as in `Series`.

    Returns:
        Shift along the direction [m], height [m], and the derivatives of both with respect to p.
    """
    t = kappa[0] * p + kappa[1] * abs(p)
    square = t * t
    u = square * np.float32(scale) - np.float32(1)
    sine, versine = series[0, 0], series[1, 0]
    for i in range(1, ORDERS):
        sine = sine * u + series[0, i]
        versine = versine * u + series[1, i]
    return p * sine - p, p * t * versine, -square * versine, t * sine


@kernel
def bend_jacobian(
    parameters: NDArray[np.float64],
    height: float,
    full_height: float,
    sides: NDArray[np.float64],
    points: NDArray[np.float64],
    rotation: NDArray[np.float64],
    per_bend: float,
    half: float,
    result: NDArray[np.float64],
) -> None:
    """Jacobian of the vertices with respect to the bends and the height map; zero for clamped parameters.

    At arc length q from the centre, an arc of curvature κ has height q (1 − cos κq)/κq and extent q sin κq/κq.

    Args:
        parameters: parameters of the bends (8,).
        height, full_height: parameter g of the height map, and its largest value; heights z become z + g z²/half.
        sides: see `SIDES`.
        points: vertices on the flat sheet (2, n) [m].
        rotation: (3, 3) from the sheet's frame, z pointing away from the sensor, to the frame of the derivatives.
        per_bend: curvature at a parameter of 1 [1/m].
        half: half the sheet's long side [m].
        result: Jacobian (n, 3, 9…), whose first nine columns are written.
    """
    g, moves = min(max(height, -full_height), full_height), np.empty((3, 9))
    for v in range(points.shape[1]):
        rise, moves[:] = 0.0, 0.0
        for i in range(8):
            q = sides[i, 0] * points[0, v] + sides[i, 1] * points[1, v]
            if q <= 0:
                continue
            end, slope = end_of(per_bend * min(max(parameters[i], -FULL), FULL) * q)
            rise += q * end.imag
            scale = per_bend * q * q if abs(parameters[i]) <= FULL else 0.0
            moves[0, i], moves[1, i] = scale * slope.real * sides[i, 0], scale * slope.real * sides[i, 1]
            moves[2, i] = -scale * slope.imag
        for i in range(8):
            moves[2, i] *= 1 + 2 * g / half * rise
        moves[2, 8] = -rise * rise / half if g == height else 0.0
        for row in range(3):
            for i in range(9):
                total = rotation[row, 0] * moves[0, i] + rotation[row, 1] * moves[1, i]
                result[v, row, i] = total + rotation[row, 2] * moves[2, i]
