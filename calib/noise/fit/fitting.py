"""Maximum likelihood of a noise model's parameters, with a share of outliers that come from anywhere."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.polynomial.polynomial import polyvander2d
from numpy.typing import NDArray

from calib.noise.base import LOG_SQRT_2PI, NoiseError
from calib.noise.fit.polynomial import Polynomials, Table
from calib.noise.fit.samples import Samples, domain

#: More samples than this are thinned at random: the parameters of a whole image need no more.
LARGEST = 200_000

#: Distances over which an outlier is uniform [m].
RANGE_M = 5.0

#: The deviation at which the fit stops, in units of the samples' spread: a sample that lies on the mean exactly would
#: be explained ever better by an ever smaller one.
_LEAST_SPREAD = 1e-3

#: Conditions along each axis of a domain at which nothing wild may be said, even if no sample lies near.
_CORNERS = 8

#: Smallest singular value of the columns, each of length 1, at which their coefficients can still be told apart.
_LEAST_VARIETY = 1e-6

#: σ of a normal distribution over its median absolute deviation.
MAD_TO_SIGMA = 1.4826


class Columns(NamedTuple):
    """What mean offset and deviation are linear in, one row per sample.

    Attributes:
        mean: (n, k); k may be 0, for no mean offset.
        spread: (n, l).
    """

    mean: NDArray[np.floating]
    spread: NDArray[np.floating]


@dataclass(frozen=True, slots=True, eq=False)
class Law:
    """Parameters of greatest likelihood.

    Attributes:
        mean: coefficients (k,) of the columns whose sum is the mean offset.
        spread: coefficients (l,) of the columns whose sum is the power of the deviation.
        outlier_share: share of the samples that are outliers, 0…0.5.
    """

    mean: NDArray[np.floating]
    spread: NDArray[np.floating]
    outlier_share: float


#: No conditions but those of the samples.
NO_CORNERS = Columns(np.zeros((0, 0)), np.zeros((0, 0)))


def maximize(
    residual: NDArray[np.floating],
    columns: Columns,
    power: int = 1,
    corners: Columns = NO_CORNERS,
    span: float = RANGE_M,
) -> Law:
    """Fits (1 − ε) N(μ, σ²) + ε uniform to residuals, with μ = columns.mean @ m and σᵖᵒʷᵉʳ = columns.spread @ s.

    Args:
        residual: measured minus real distance (n,) [m], or another number.
        columns: of every sample.
        power: 1 if the deviation is linear in its parameters, 2 if the variance is.
        corners: of conditions under which there may be no sample. Each counts like one sample of the usual mean and
            spread: nothing beside thousands of real ones, and enough that nothing wild is said where there are none.
        span: range over which an outlier is uniform, in the unit of the residuals.

    Raises:
        NoiseError: the samples do not vary enough to tell the coefficients of all columns.
    """
    for part in columns:
        _check_variety(part)
    unit, usual = _spread_of(residual), float(np.median(residual))
    q_mean, r_mean = np.linalg.qr(columns.mean)  # orthogonal columns, however different the powers of x and a are
    q_spread, r_spread = np.linalg.qr(columns.spread)
    k = q_mean.shape[1]
    samples = _Samples(residual / unit, Columns(q_mean, q_spread), power, unit / span)
    turned = Columns(_solved(corners.mean, r_mean), _solved(corners.spread, r_spread))
    imagined = _Imagined(usual / unit, turned, power)

    def cost(parameters: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Negative log-likelihood per sample, and its gradient; the share ε is in its logit."""
        real, by_real = samples.cost(parameters[:k], parameters[k:-1], parameters[-1])
        weak, by_weak = imagined.cost(parameters[:k], parameters[k:-1])
        return (real + weak) / len(residual), (by_real + by_weak) / len(residual)

    start = np.concatenate([*_start(samples.residual, samples.columns, power), [scipy.special.logit(0.02)]])
    bounds = [(None, None)] * (len(start) - 1) + [tuple(scipy.special.logit([1e-6, 0.5]))]
    options = {"maxiter": 500, "ftol": 1e-12, "gtol": 1e-8}
    best = scipy.optimize.minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options).x
    return Law(
        np.linalg.solve(r_mean, best[:k]) * unit,
        np.linalg.solve(r_spread, best[k:-1]) * unit**power,
        float(scipy.special.expit(best[-1])),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Samples:
    """What real samples say of the parameters, in units of their spread; `uniform` is the density of an outlier."""

    residual: NDArray[np.floating]
    columns: Columns
    power: int
    uniform: float

    def cost(self, m: NDArray[np.float64], s: NDArray[np.float64], logit: float) -> tuple[float, NDArray[np.floating]]:
        """Negative log-likelihood, and its gradient by m, s and the logit of the outliers' share."""
        share = scipy.special.expit(logit)
        v, inside = _bounded(self.columns.spread @ s, self.power)
        sigma = v ** (1 / self.power)
        z = (self.residual - self.columns.mean @ m) / sigma
        normal = np.exp(-0.5 * z**2 - LOG_SQRT_2PI) / sigma
        density = (1 - share) * normal + share * self.uniform
        weight = (1 - share) * normal / density
        by_mean = -self.columns.mean.T @ (weight * z / sigma)
        by_spread = self.columns.spread.T @ (inside * weight * (1 - z**2) / (self.power * v))
        by_logit = ((normal - self.uniform) / density).sum() * share * (1 - share)
        return -float(np.log(density).sum()), np.concatenate([by_mean, by_spread, [by_logit]])


@dataclass(frozen=True, slots=True, eq=False)
class _Imagined:
    """What one sample of the usual mean and of spread 1 would say under each of some conditions, on average."""

    usual: float
    columns: Columns
    power: int

    def cost(self, m: NDArray[np.float64], s: NDArray[np.float64]) -> tuple[float, NDArray[np.floating]]:
        """Negative log-likelihood, and its gradient by m, s and the logit, on which it does not depend."""
        v, inside = _bounded(self.columns.spread @ s, self.power)
        variance = v ** (2 / self.power)
        off = self.columns.mean @ m - self.usual
        square = (1 + off**2) / variance
        by_mean = self.columns.mean.T @ (off / variance)
        by_spread = self.columns.spread.T @ (inside * (1 - square) / (self.power * v))
        total = np.log(v).sum() / self.power + 0.5 * square.sum()
        return float(total), np.concatenate([by_mean, by_spread, [0.0]])


def polynomials(samples: Samples, sigma_degrees: tuple[int, int], mu_degrees: tuple[int, int]) -> Polynomials:
    """One pair of polynomials for all samples; σ is never less than nearly the least that they show.

    Args:
        samples: measurements; the domain is where they lie.
        sigma_degrees, mu_degrees: highest powers of the distance and of the amplitude.

    Raises:
        NoiseError: no sample has a distance or, where a power of the amplitude is asked for, an amplitude; or they vary
            too little for so many powers.
    """
    samples = thinned(samples.returns(with_amplitude=max(sigma_degrees[1], mu_degrees[1]) > 0))
    distances = domain(samples.true)
    amplitudes = domain(samples.amplitude) if np.isfinite(samples.amplitude).all() else (0.0, 65535.0)
    x, a = np.clip(samples.true, *distances), np.nan_to_num(np.clip(samples.amplitude, *amplitudes))
    columns = Columns(polyvander2d(x, a, mu_degrees), polyvander2d(x, a, sigma_degrees))
    x, a = (part.ravel() for part in np.meshgrid(*(np.linspace(*span, _CORNERS) for span in (distances, amplitudes))))
    corners = Columns(polyvander2d(x, a, mu_degrees), polyvander2d(x, a, sigma_degrees))
    law = maximize(samples.residual, columns, corners=corners)
    sigma = law.spread.reshape(sigma_degrees[0] + 1, sigma_degrees[1] + 1, 1)
    mu = law.mean.reshape(mu_degrees[0] + 1, mu_degrees[1] + 1, 1)
    least = least_sigma(columns.spread @ law.spread)
    return Polynomials(sigma, mu, distances, amplitudes, least)


def thinned(samples: Samples) -> Samples:
    """At most `LARGEST` of the samples, drawn at random and the same every time."""
    if len(samples) <= LARGEST:
        return samples
    return samples.take(np.random.default_rng(0).choice(len(samples), LARGEST, replace=False))


def least_sigma(sigma: NDArray[np.floating]) -> float:
    """Lower bound for a fitted deviation, so that it stays sensible where the domain's corners hold no sample [m]."""
    return max(float(np.quantile(sigma, 0.005)), 1e-6)


def table(coefficients: NDArray[np.floating]) -> Table:
    """Coefficients (i, j) as a rig file has them."""
    return tuple(tuple(row) for row in coefficients.tolist())


def _spread_of(residual: NDArray[np.floating]) -> float:
    """Robust deviation [m]; where most residuals are equal, their mean absolute one, and never zero."""
    size = np.abs(residual - np.median(residual))
    return float(max(np.median(size) * MAD_TO_SIGMA, size.mean() * 1e-3, 1e-9))


def _check_variety(columns: NDArray[np.floating]) -> None:
    scaled = columns / np.linalg.norm(columns, axis=0)
    if columns.shape[1] and np.linalg.svd(scaled, compute_uv=False)[-1] < _LEAST_VARIETY:
        raise NoiseError(
            f"the samples vary too little to tell {columns.shape[1]} coefficients apart; "
            "measure at more distances and on more materials, or ask for lower powers"
        )


def _solved(columns: NDArray[np.floating], triangle: NDArray[np.floating]) -> NDArray[np.floating]:
    """Columns (g, k) in the coordinates in which those of the samples are orthogonal; there may be no row at all."""
    return np.linalg.solve(triangle.T, columns.reshape(len(columns), len(triangle)).T).T


def _bounded(v: NDArray[np.floating], power: int) -> tuple[NDArray[np.floating], NDArray[np.bool_]]:
    """A deviation's power, not too small, and where it was not."""
    least = _LEAST_SPREAD**power
    return np.maximum(v, least), v > least


def _start(r: NDArray[np.floating], columns: Columns, power: int) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Least squares without what is far off; orthogonal columns. A spread below zero somewhere begins as a constant."""
    mean, spread = columns
    middle = np.median(r) if mean.shape[1] else 0.0
    offset = mean.T @ np.clip(r, middle - 5, middle + 5)
    size = np.minimum(np.abs(r - mean @ offset) * np.sqrt(np.pi / 2), 5) ** power
    linear = spread.T @ size
    constant = spread.T @ np.full(len(r), size.mean())
    return offset, linear if (spread @ linear).min() > _LEAST_SPREAD**power else constant
