"""Empirical Bayes shrinkage: noise of regions towards the image, of pixels towards their region.

The variation among regions (or pixels) is estimated from all of them together; each is shrunk towards its parent
according to the information in its own samples. With few samples it equals its parent.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.polynomial.polynomial import polypow, polyvander
from numpy.typing import NDArray

from calib.noise.base import LOG_SQRT_2PI
from calib.noise.fit.fitting import MAD_TO_SIGMA, RANGE_M
from calib.noise.fit.polynomial import Polynomials, Span
from calib.noise.fit.samples import Samples

#: Iterations of expectation–maximisation; with tens of samples per pixel, twice as many change no offset by more than
#: 0.01 mm.
_ROUNDS = 40

#: Variation of mean offsets below this is treated as zero [m].
_EQUAL_M = 1e-6

#: Minimum number of samples of a region or pixel that contributes to the variation of the deviations.
_FEW = 4

#: Lower bound of a factor on the deviation: a place that repeats itself is stuck or filtered, not ten times better.
MIN_FACTOR = 0.1


class Repeats(NamedTuple):
    """Number and scatter of the measurements that a sample is the mean of, as in sequences of a static scene.

    Attributes:
        times: number of measurements, (n,) or (1,).
        variance: mean squared difference from the sample [m²], likewise.
    """

    times: NDArray[np.floating]
    variance: NDArray[np.floating]


#: Every sample is a single measurement.
ONCE = Repeats(np.ones(1), np.zeros(1))


@dataclass(frozen=True, slots=True, eq=False)
class _Groups:
    """Residuals from the parent, grouped by place.

    Attributes:
        residual, deviation: residual of every sample from the parent's mean, and the parent's deviation (n,) [m].
        basis: design matrix (n, k) of the groups' own mean offsets.
        of: index of the group of every sample (n,).
        number: number of groups.
        repeats: replicates of the samples.
        minimum: lower bound of the factor on the deviation (groups,).
    """

    residual: NDArray[np.float64]
    deviation: NDArray[np.float64]
    basis: NDArray[np.floating]
    of: NDArray[np.int64]
    number: int
    repeats: Repeats
    minimum: NDArray[np.float64]

    def sum(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums (groups,) of values (n,)."""
        return np.asarray(np.bincount(self.of, values, self.number), np.float64)

    def medians(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Medians (groups,) of values (n,); 0 for an empty group."""
        order = np.lexsort((values, self.of))
        count = np.bincount(self.of, minlength=self.number)
        middle = np.concatenate([[0], np.cumsum(count)[:-1]]) + (count - 1) // 2
        return np.where(count > 0, values[order[np.minimum(middle, len(values) - 1)]], 0.0)


def refine(
    parent: Polynomials,
    parent_of: NDArray[np.integer],
    samples: Samples,
    place: NDArray[np.integer],
    degree: int,
) -> Polynomials:
    """Polynomials of smaller places: the parent's plus an own mean offset in x, with an own factor on the deviation.

    Args:
        parent: polynomials of the larger places.
        parent_of: index of the larger place (places,) that contains each smaller one.
        samples: measurements with distances and, if the parent uses them, amplitudes.
        place: index of the smaller place (n,) of every sample.
        degree: degree of the own mean offset in the distance.
    """
    at = parent_of[place]
    residual = samples.residual - parent.mean(samples.true, samples.amplitude, at)
    deviation = parent.deviation(samples.true, samples.amplitude, at)
    near, far = parent.distances
    middle, half = (near + far) / 2, (far - near) / 2
    basis = basis_of(samples.true, parent.distances, degree)
    offsets, factors = shrink(residual, deviation, basis, place, len(parent_of), minimum=samples.minimum_sigma)
    mu = np.zeros((max(parent.mu.shape[0], degree + 1), parent.mu.shape[1], len(parent_of)))
    mu[: parent.mu.shape[0]] = parent.mu[..., parent_of]
    for power in range(degree + 1):
        raw = polypow([-middle / half, 1 / half], power)  # ((x − middle) / half)ᵖᵒʷᵉʳ as a polynomial in x
        mu[: power + 1, 0] += np.outer(raw, offsets[:, power])
    minimum = parent.minimum_sigma * float(factors.min())
    return Polynomials(parent.sigma[..., parent_of] * factors, mu, parent.distances, parent.amplitudes, minimum)


def basis_of(x: NDArray[np.floating], distances: Span, degree: int) -> NDArray[np.floating]:
    """Powers (n, degree + 1) of distances (n,), scaled so that the domain is [−1, 1] and clamped to it."""
    near, far = distances
    return polyvander((2 * np.clip(x, near, far) - near - far) / (far - near), degree)


def shrink(
    residual: NDArray[np.float64],
    deviation: NDArray[np.float64],
    basis: NDArray[np.floating],
    place: NDArray[np.integer],
    places: int,
    repeats: Repeats = ONCE,
    minimum: float | NDArray[np.float64] = 0.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Offsets and deviation factors of places relative to their parent, by expectation–maximisation.

    Args:
        residual: of the samples from the parent's mean (n,) [m].
        deviation: the parent's deviation (n,) [m].
        basis: design matrix (n, k) of a place's own mean offset.
        place: index of the place of every sample (n,).
        places: number of places.
        repeats: replicates of the samples.
        minimum: deviation of the quantisation error [m], a number or (n,): a place that repeats one value does not show
            it, and own offsets make up for it.

    Returns:
        Coefficients of the own mean offsets (places, k), and factors on the deviation (places,).
    """
    of = place.astype(np.int64)
    mean_square = np.bincount(of, np.square(minimum / deviation), places) / np.bincount(of, minlength=places).clip(1)
    floor = np.maximum(np.sqrt(mean_square), MIN_FACTOR)
    groups = _Groups(residual, deviation, basis, of, places, repeats, floor)
    offsets = np.zeros((groups.number, groups.basis.shape[1]))
    offsets[:, 0] = groups.medians(groups.residual)
    rest = np.sqrt(np.square(groups.residual - offsets[groups.of, 0]) + repeats.variance) / groups.deviation
    factors = np.full(groups.number, max(float(np.median(rest)) * MAD_TO_SIGMA, 1e-3))
    prior = np.eye(offsets.shape[1]) * (np.var(offsets[:, 0]) + _EQUAL_M**2)
    share = 0.02
    for _ in range(_ROUNDS):
        weight, share = _inliers(groups, offsets, factors, share)
        offsets, prior, used = _offsets(groups, weight, factors, prior)
        factors = _factors(groups, weight, offsets, used)
    return offsets, factors


def _inliers(
    groups: _Groups, offsets: NDArray[np.float64], factors: NDArray[np.float64], share: float
) -> tuple[NDArray[np.float64], float]:
    """Weight (n,) of every sample: number of inlier measurements; and the outlier fraction."""
    sigma = factors[groups.of] * groups.deviation
    rest = groups.residual - np.einsum("nk,nk->n", groups.basis, offsets[groups.of])
    inlier = (1 - share) * np.exp(-0.5 * (rest**2 + groups.repeats.variance) / sigma**2 - LOG_SQRT_2PI) / sigma
    weight = inlier / (inlier + share / RANGE_M)
    return groups.repeats.times * weight, float(np.clip(1 - weight.mean(), 1e-6, 0.5))


def _offsets(
    groups: _Groups, weight: NDArray[np.float64], factors: NDArray[np.float64], prior: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Posterior offsets (groups, k) under a normal prior (k, k), the next prior, effective parameters (groups,)."""
    k = groups.basis.shape[1]
    precision = weight / (factors[groups.of] * groups.deviation) ** 2
    information = np.empty((groups.number, k, k))
    moments = np.empty((groups.number, k))
    for i in range(k):
        moments[:, i] = groups.sum(precision * groups.basis[:, i] * groups.residual)
        for j in range(i + 1):
            information[:, i, j] = information[:, j, i] = groups.sum(
                precision * groups.basis[:, i] * groups.basis[:, j]
            )
    covariance = np.linalg.inv(information + np.linalg.inv(prior))
    offsets = np.einsum("gij,gj->gi", covariance, moments)
    known = groups.sum(weight) > 0
    following = (np.einsum("gi,gj->ij", offsets[known], offsets[known]) + covariance[known].sum(axis=0)) / known.sum()
    return offsets, following + np.eye(k) * _EQUAL_M**2, np.einsum("gij,gji->g", information, covariance)


def _factors(
    groups: _Groups, weight: NDArray[np.float64], offsets: NDArray[np.float64], used: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Factors (groups,) on the deviation: variances shrunk towards their common one (Smyth, SAGMB 3, 2004)."""
    rest = groups.residual - np.einsum("nk,nk->n", groups.basis, offsets[groups.of])
    squares = groups.sum(weight * (rest**2 + groups.repeats.variance) / groups.deviation**2)
    freedom = np.maximum(groups.sum(weight) - used, 0)
    squares = np.maximum(squares, freedom * groups.minimum**2)
    common, confidence = _common_variance(squares, freedom)
    return np.maximum(np.sqrt((confidence * common + squares) / (confidence + freedom)), groups.minimum)


def _common_variance(squares: NDArray[np.float64], freedom: NDArray[np.float64]) -> tuple[float, float]:
    """Common variance of the groups, and the prior's degrees of freedom.

    By the moments of the logarithm of a scaled F distribution.
    """
    usable = (freedom >= _FEW) & (squares > 0)
    if not usable.any():
        return max(float(squares.sum() / max(freedom.sum(), 1.0)), 1e-6), 1.0
    half = freedom[usable] / 2
    logarithm = np.log(squares[usable] / freedom[usable]) - scipy.special.digamma(half) + np.log(half)
    excess = float(np.var(logarithm) - scipy.special.polygamma(1, half).mean())
    if excess <= 1e-6:  # no more scatter than sampling alone explains
        return float(squares[usable].sum() / freedom[usable].sum()), 1e6
    confidence = 2 * scipy.optimize.brentq(lambda y: scipy.special.polygamma(1, y) - excess, 1e-3, 1e7)
    centre = logarithm.mean() + scipy.special.digamma(confidence / 2) - np.log(confidence / 2)
    return float(np.exp(centre)), float(confidence)
