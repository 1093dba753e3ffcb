"""From an image's noise to its regions' and from a region's to its pixels', as far as their samples tell.

Empirical Bayes: how much regions (or pixels) differ from what they are part of is estimated from all of them together,
and each is moved towards it by as much as its own samples leave open. Thin data so become the parent's values and never
nonsense.
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

#: Rounds of expectation and maximisation; where there are tens of samples a pixel, twice as many move no offset by more
#: than 0.01 mm.
_ROUNDS = 40

#: Regions or pixels whose mean offsets differ by less than this are taken as equal [m].
_EQUAL_M = 1e-6

#: Fewer samples say nothing about how much the deviations of regions or pixels differ.
_FEW = 4


class Repeats(NamedTuple):
    """How many measurements a sample is the mean of, and how they scatter; sequences of a thing at rest have many.

    Attributes:
        times: of them, (n,) or (1,).
        variance: mean square of their differences from the sample [m²], likewise.
    """

    times: NDArray[np.floating]
    variance: NDArray[np.floating]


#: Every sample is one measurement.
ONCE = Repeats(np.ones(1), np.zeros(1))


@dataclass(frozen=True, slots=True, eq=False)
class _Groups:
    """Residuals from the parent, by group.

    Attributes:
        residual, deviation: of every sample from the parent's mean, and the parent's deviation (n,) [m].
        basis: columns (n, k) in which the groups' own mean offsets are linear.
        of: group (n,) of every sample.
        number: of groups.
        repeats: of the samples.
    """

    residual: NDArray[np.float64]
    deviation: NDArray[np.float64]
    basis: NDArray[np.floating]
    of: NDArray[np.int64]
    number: int
    repeats: Repeats

    def sum(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums (groups,) of values (n,)."""
        return np.asarray(np.bincount(self.of, values, self.number), np.float64)

    def medians(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Medians (groups,) of values (n,); 0 where there is no sample."""
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
    """Polynomials of smaller places: a parent's, plus an own mean offset in x, with an own factor on the deviation.

    Args:
        parent: polynomials of larger places.
        parent_of: the larger place (places,) that every smaller one is part of.
        samples: measurements with distances and, if the parent uses them, amplitudes.
        place: smaller place (n,) of every sample.
        degree: highest power of the distance in the own mean offset.
    """
    at = parent_of[place]
    residual = samples.residual - parent.mean(samples.true, samples.amplitude, at)
    deviation = parent.deviation(samples.true, samples.amplitude, at)
    near, far = parent.distances
    middle, half = (near + far) / 2, (far - near) / 2
    basis = basis_of(samples.true, parent.distances, degree)
    offsets, factors = own(residual, deviation, basis, place, len(parent_of))
    mu = np.zeros((max(parent.mu.shape[0], degree + 1), parent.mu.shape[1], len(parent_of)))
    mu[: parent.mu.shape[0]] = parent.mu[..., parent_of]
    for power in range(degree + 1):
        raw = polypow([-middle / half, 1 / half], power)  # ((x − middle) / half)ᵖᵒʷᵉʳ as a polynomial in x
        mu[: power + 1, 0] += np.outer(raw, offsets[:, power])
    least = parent.least_sigma * float(factors.min())
    return Polynomials(parent.sigma[..., parent_of] * factors, mu, parent.distances, parent.amplitudes, least)


def basis_of(x: NDArray[np.floating], distances: Span, degree: int) -> NDArray[np.floating]:
    """Powers (n, degree + 1) of distances (n,), moved and scaled so that the domain is −1 to 1; beyond, its edge."""
    near, far = distances
    return polyvander((2 * np.clip(x, near, far) - near - far) / (far - near), degree)


def own(
    residual: NDArray[np.float64],
    deviation: NDArray[np.float64],
    basis: NDArray[np.floating],
    place: NDArray[np.integer],
    places: int,
    repeats: Repeats = ONCE,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How places differ from what they are part of, by expectation and maximisation.

    Args:
        residual: of the samples from the parent's mean (n,) [m].
        deviation: that the parent says they have (n,) [m].
        basis: columns (n, k) in which a place's own mean offset is linear.
        place: of every sample (n,).
        places: number of them.
        repeats: measurements that every sample stands for.

    Returns:
        Own mean offsets (places, k), in the columns, and factors on the deviation (places,).
    """
    groups = _Groups(residual, deviation, basis, place.astype(np.int64), places, repeats)
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
    """Measurements (n,) of every sample that are no outliers, and the outliers' share."""
    sigma = factors[groups.of] * groups.deviation
    rest = groups.residual - np.einsum("nk,nk->n", groups.basis, offsets[groups.of])
    inlier = (1 - share) * np.exp(-0.5 * (rest**2 + groups.repeats.variance) / sigma**2 - LOG_SQRT_2PI) / sigma
    weight = inlier / (inlier + share / RANGE_M)
    return groups.repeats.times * weight, float(np.clip(1 - weight.mean(), 1e-6, 0.5))


def _offsets(
    groups: _Groups, weight: NDArray[np.float64], factors: NDArray[np.float64], prior: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Offsets (groups, k) under a normal prior of covariance (k, k), the next prior, and parameters used (groups,)."""
    k = groups.basis.shape[1]
    precision = weight / (factors[groups.of] * groups.deviation) ** 2
    information = np.empty((groups.number, k, k))
    told = np.empty((groups.number, k))
    for i in range(k):
        told[:, i] = groups.sum(precision * groups.basis[:, i] * groups.residual)
        for j in range(i + 1):
            information[:, i, j] = information[:, j, i] = groups.sum(
                precision * groups.basis[:, i] * groups.basis[:, j]
            )
    covariance = np.linalg.inv(information + np.linalg.inv(prior))
    offsets = np.einsum("gij,gj->gi", covariance, told)
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
    common, confidence = _common_variance(squares, freedom)
    return np.sqrt((confidence * common + squares) / (confidence + freedom))


def _common_variance(squares: NDArray[np.float64], freedom: NDArray[np.float64]) -> tuple[float, float]:
    """The variance that all groups scatter around, and how many samples' worth each knows of it by being one of them.

    Moments of the logarithm of a scaled F distribution.
    """
    told = (freedom >= _FEW) & (squares > 0)
    if not told.any():
        return max(float(squares.sum() / max(freedom.sum(), 1.0)), 1e-6), 1.0
    half = freedom[told] / 2
    logarithm = np.log(squares[told] / freedom[told]) - scipy.special.digamma(half) + np.log(half)
    excess = float(np.var(logarithm) - scipy.special.polygamma(1, half).mean())
    if excess <= 1e-6:  # no more scatter than so few samples have anyway
        return float(squares[told].sum() / freedom[told].sum()), 1e6
    confidence = 2 * scipy.optimize.brentq(lambda y: scipy.special.polygamma(1, y) - excess, 1e-3, 1e7)
    centre = logarithm.mean() + scipy.special.digamma(confidence / 2) - np.log(confidence / 2)
    return float(np.exp(centre)), float(confidence)
