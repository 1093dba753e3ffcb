"""Polynomials in distance and amplitude with coefficients of the image, of regions or of pixels (eq. 18)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel
from calib.noise.base import NoiseError

#: Coefficients [i][j] of xⁱ aʲ, as in a rig file.
Table = tuple[tuple[float, ...], ...]

#: Lowest and highest value of a calibrated domain.
Span = tuple[float, float]

#: Index of the only coefficients if one polynomial applies to the whole image.
EVERYWHERE = np.zeros(1, np.int64)

#: Samples per block: intermediate results stay in the first-level cache.
_BLOCK = 256


def check_table(key: str, table: Table) -> None:
    """Checks that a table has rows of equal length.

    Raises:
        NoiseError: it has not; names the key.
    """
    if not table or not table[0] or len({len(row) for row in table}) != 1:
        raise NoiseError(f"{key} must be a table of rows of equal length, {key}[i][j] for xⁱ aʲ, not {table}")


def check_span(key: str, span: Span) -> None:
    """Checks that a domain is [lowest, highest] with lowest < highest.

    Raises:
        NoiseError: it is not; names the key.
    """
    low, high = span
    if not low < high:
        raise NoiseError(f"{key} must be [lowest, highest] with lowest < highest, not {[low, high]}")


@dataclass(frozen=True, eq=False)
class Polynomials:
    """μ and σ as polynomials in distance x and amplitude a, with separate coefficients for every place.

    A place is the whole image, a region or a pixel. Arguments are clamped to the domain.

    Attributes:
        sigma: coefficients of the deviation [m], (i, j, places): [i, j] belongs to xⁱ aʲ.
        mu: coefficients of the mean offset [m], likewise.
        distances, amplitudes: calibrated domain.
        minimum_sigma: lower bound of the deviation [m].
    """

    sigma: NDArray[np.floating]
    mu: NDArray[np.floating]
    distances: Span
    amplitudes: Span
    minimum_sigma: float

    @property
    def use_amplitude(self) -> bool:
        """True if a power of the amplitude occurs."""
        return self.sigma.shape[1] > 1 or self.mu.shape[1] > 1

    def mean(self, x: NDArray[np.float64], a: NDArray[np.float64], place: NDArray[np.integer]) -> NDArray[np.float64]:
        """Mean offset μ(x, a) [m] at places (n,) or (1,)."""
        return evaluate(self.mu, place, x, a, self.distances, self.amplitudes)

    def deviation(
        self, x: NDArray[np.float64], a: NDArray[np.float64], place: NDArray[np.integer]
    ) -> NDArray[np.float64]:
        """Standard deviation σ(x, a) [m] at places (n,) or (1,)."""
        return np.maximum(evaluate(self.sigma, place, x, a, self.distances, self.amplitudes), self.minimum_sigma)


def evaluate(
    coefficients: NDArray[np.floating],
    place: NDArray[np.integer],
    x: NDArray[np.float64],
    a: NDArray[np.float64],
    distances: Span,
    amplitudes: Span,
) -> NDArray[np.float64]:
    """Σ coefficients[i, j, place] xⁱ aʲ, with x and a clamped to the domain; NaN stays NaN.

    The powers of the amplitude are summed once for all distances of a sample. If only the zeroth power occurs, the
    amplitude is ignored and may be NaN.

    Args:
        coefficients: (i, j, places).
        place: index of the coefficients of each sample, (n,) or (1,) for all; instead of n there may be several axes.
        x: distances (…, n) [m].
        a: amplitudes, like `place`.
        distances, amplitudes: the domain.

    Raises:
        IndexError: index out of range; the compiled loop does not check it.
    """
    if not _all_within(place, coefficients.shape[2]):
        raise IndexError(f"places {place.min()} to {place.max()} of {coefficients.shape[2]}")
    if coefficients.size == 1:  # such as no mean offset: the same everywhere
        return np.full(np.shape(x), coefficients.item(), np.float64)
    x, a = np.ascontiguousarray(x, np.float64), np.asarray(a, np.float64)
    outer = x.ndim - max(a.ndim, place.ndim)
    one = x.shape[outer:]
    out = np.empty((math.prod(x.shape[:outer]), math.prod(one)))
    _evaluate(
        np.ascontiguousarray(coefficients, np.float64),
        (place if place.size == 1 else np.broadcast_to(place, one)).astype(np.int64).ravel(),
        x.reshape(out.shape),
        (np.broadcast_to(a, one) if coefficients.shape[1] > 1 and a.shape != one else a).astype(np.float64).ravel(),
        np.array([*distances, *amplitudes], np.float64),
        out,
    )
    return out.reshape(x.shape)


def _all_within(place: NDArray[np.integer], count: int) -> bool:
    """True if all places are below a count; most often there is one, for all samples."""
    if place.size == 1:
        return 0 <= place.item() < count
    return not place.size or bool(place.min() >= 0 and place.max() < count)


@kernel
def _evaluate(
    coefficients: NDArray[np.float64],
    place: NDArray[np.int64],
    x: NDArray[np.float64],
    a: NDArray[np.float64],
    domain: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Horner's scheme, first in the amplitude and then in the distance, in blocks so that the loops vectorise.

    The place may be one for all samples, and the amplitude is not read if only its zeroth power occurs.
    """
    nearest, farthest, faintest, brightest = domain
    rows, columns, _ = coefficients.shape
    sums, inside, coefficient = np.empty((rows, _BLOCK)), np.empty(_BLOCK), np.empty(_BLOCK)
    for first in range(0, x.shape[1], _BLOCK):
        last = min(first + _BLOCK, x.shape[1])
        at, n = place[first:last] if place.size > 1 else place, last - first
        if columns > 1:
            _clip(a[first:last], faintest, brightest, inside)
        for i in range(rows):
            partial = sums[i, :n]
            _look_up(coefficients[i, columns - 1], at, partial)
            for j in range(columns - 2, -1, -1):
                _look_up(coefficients[i, j], at, coefficient[:n])
                for k in range(n):
                    partial[k] = partial[k] * inside[k] + coefficient[k]
        for node in range(x.shape[0]):
            _clip(x[node, first:last], nearest, farthest, inside)
            value = out[node, first:last]
            for k in range(n):
                value[k] = sums[rows - 1, k]
            for i in range(rows - 2, -1, -1):
                partial = sums[i]
                for k in range(n):
                    value[k] = value[k] * inside[k] + partial[k]


@kernel
def _clip(values: NDArray[np.float64], low: float, high: float, out: NDArray[np.float64]) -> None:
    """Values clamped to a range; NaN stays NaN."""
    for k in range(values.size):
        v = values[k]
        out[k] = low if v < low else (high if v > high else v)


@kernel
def _look_up(plane: NDArray[np.float64], at: NDArray[np.int64], out: NDArray[np.float64]) -> None:
    """Coefficient of every place; a single coefficient for all is read once, so that the loop vectorises."""
    if at.size == 1:
        single = plane[at[0]]
        for k in range(out.size):
            out[k] = single
    else:
        for k in range(out.size):
            out[k] = plane[at[k]]
