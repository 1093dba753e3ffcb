"""Maximum-likelihood fit of a noise model's parameters, with a fraction of uniform outliers."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.polynomial.polynomial import polyvander2d
from numpy.typing import NDArray

from calib.noise.base import LOG_SQRT_2PI, NoiseError
from calib.noise.fit.polynomial import Polynomials, Table
from calib.noise.fit.samples import Samples, domain

#: Samples beyond this number are subsampled at random.
MAX_SAMPLES = 200_000

#: Distances over which an outlier is uniform [m].
RANGE_M = 5.0

#: Lower bound of the fitted deviation, in units of the samples' spread; without it, a sample exactly on the mean makes
#: the likelihood unbounded.
_MIN_SPREAD = 1e-3

#: Pseudo-samples along each axis of the domain, which regularise conditions without real samples.
_PSEUDO_SAMPLES = 8

#: Smallest singular value of a design matrix with unit columns for which its coefficients are identifiable.
_MIN_VARIETY = 1e-6

#: σ of a normal distribution over its median absolute deviation.
MAD_TO_SIGMA = 1.4826


class Design(NamedTuple):
    """Design matrices of mean offset and deviation, one row per sample.

    Attributes:
        mean: (n, k); k may be 0, for no mean offset.
        spread: (n, l).
    """

    mean: NDArray[np.floating]
    spread: NDArray[np.floating]


@dataclass(frozen=True, slots=True, eq=False)
class FittedNoise:
    """Maximum-likelihood parameters.

    Attributes:
        mean: coefficients (k,) of the mean offset.
        spread: coefficients (l,) of the deviation to the chosen power.
    """

    mean: NDArray[np.floating]
    spread: NDArray[np.floating]


#: No regularisation.
NO_PSEUDO_SAMPLES = Design(np.zeros((0, 0)), np.zeros((0, 0)))


def maximize_likelihood(
    residual: NDArray[np.floating],
    columns: Design,
    power: int = 1,
    pseudo_samples: Design = NO_PSEUDO_SAMPLES,
    span: float = RANGE_M,
    minimum: float | NDArray[np.floating] = 0.0,
) -> FittedNoise:
    """Fits (1 − ε) N(μ, σ²) + ε uniform to residuals, with μ = columns.mean @ m and σᵖᵒʷᵉʳ = columns.spread @ s.

    Args:
        residual: measured minus true value (n,) [m], or another unit.
        columns: design matrices of the samples.
        power: 1 if the deviation is linear in its parameters, 2 if the variance is.
        pseudo_samples: design matrices of conditions that may lack real samples. Each counts as one sample of median
            mean and spread: negligible beside thousands of real ones, but enough to bound the extrapolation.
        span: range over which an outlier is uniform, in the unit of the residuals.
        minimum: lower bound of the deviation of every sample, in the unit of the residuals: values that come in steps
            may repeat exactly, which would make the likelihood of no deviation unbounded.

    Raises:
        NoiseError: the samples vary too little to identify all coefficients.
    """
    for part in columns:
        _check_variety(part)
    unit, center = _spread_of(residual), float(np.median(residual))
    q_mean, r_mean = np.linalg.qr(columns.mean)  # orthogonal columns: powers of x and a differ by orders of magnitude
    q_spread, r_spread = np.linalg.qr(columns.spread)
    k = q_mean.shape[1]
    bound = np.maximum(minimum / unit, _MIN_SPREAD)
    samples = ResidualSamples(residual / unit, Design(q_mean, q_spread), power, unit / span, bound)
    turned = Design(_solved(pseudo_samples.mean, r_mean), _solved(pseudo_samples.spread, r_spread))
    regularization = PseudoSamples(center / unit, turned, power)

    def cost(parameters: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Negative log-likelihood per sample, and its gradient; ε is parametrised by its logit."""
        real, by_real = samples.cost(parameters[:k], parameters[k:-1], parameters[-1])
        weak, by_weak = regularization.cost(parameters[:k], parameters[k:-1])
        return (real + weak) / len(residual), (by_real + by_weak) / len(residual)

    start = np.concatenate([*_start(samples), [scipy.special.logit(0.02)]])
    bounds = [(None, None)] * (len(start) - 1) + [tuple(scipy.special.logit([1e-6, 0.5]))]
    options = {"maxiter": 500, "ftol": 1e-12, "gtol": 1e-8}
    best = scipy.optimize.minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options).x
    mean, spread = np.linalg.solve(r_mean, best[:k]), np.linalg.solve(r_spread, best[k:-1])
    return FittedNoise(mean * unit, spread * unit**power)


@dataclass(frozen=True, slots=True, eq=False)
class ResidualSamples:
    """Log-likelihood of the samples, in units of their spread.

    Attributes:
        residual: measured minus true values (n,).
        columns: design matrices.
        power: of the deviation that is linear in its parameters.
        uniform: density of an outlier.
        minimum: lower bound of the deviation, a number or (n,).
    """

    residual: NDArray[np.floating]
    columns: Design
    power: int
    uniform: float
    minimum: float | NDArray[np.floating] = _MIN_SPREAD

    def cost(self, m: NDArray[np.float64], s: NDArray[np.float64], logit: float) -> tuple[float, NDArray[np.floating]]:
        """Negative log-likelihood, and its gradient with respect to m, s and the logit of ε."""
        share = scipy.special.expit(logit)
        v, inside = _bounded(self.columns.spread @ s, self.minimum**self.power)
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
class PseudoSamples:
    """Expected log-likelihood of one pseudo-sample of mean `center` and spread 1 under each condition."""

    center: float
    columns: Design
    power: int

    def cost(self, m: NDArray[np.float64], s: NDArray[np.float64]) -> tuple[float, NDArray[np.floating]]:
        """Negative log-likelihood, and its gradient with respect to m, s and the logit of ε, which is zero."""
        v, inside = _bounded(self.columns.spread @ s, _MIN_SPREAD**self.power)
        variance = v ** (2 / self.power)
        off = self.columns.mean @ m - self.center
        square = (1 + off**2) / variance
        by_mean = self.columns.mean.T @ (off / variance)
        by_spread = self.columns.spread.T @ (inside * (1 - square) / (self.power * v))
        total = np.log(v).sum() / self.power + 0.5 * square.sum()
        return float(total), np.concatenate([by_mean, by_spread, [0.0]])


def polynomials(samples: Samples, sigma_degrees: tuple[int, int], mu_degrees: tuple[int, int]) -> Polynomials:
    """One pair of polynomials for all samples; σ is bounded below by about its smallest fitted value.

    Args:
        samples: measurements; they determine the domain.
        sigma_degrees, mu_degrees: degrees in distance and amplitude.

    Raises:
        NoiseError: no sample has a distance or, if the polynomials use it, an amplitude; or the samples vary too little
            for these degrees.
    """
    samples = subsampled(samples.returns(with_amplitude=max(sigma_degrees[1], mu_degrees[1]) > 0))
    distances = domain(samples.true)
    amplitudes = domain(samples.amplitude) if np.isfinite(samples.amplitude).all() else (0.0, 65535.0)
    x, a = np.clip(samples.true, *distances), np.nan_to_num(np.clip(samples.amplitude, *amplitudes))
    columns = Design(polyvander2d(x, a, mu_degrees), polyvander2d(x, a, sigma_degrees))
    x, a = (
        part.ravel() for part in np.meshgrid(*(np.linspace(*span, _PSEUDO_SAMPLES) for span in (distances, amplitudes)))
    )
    pseudo_samples = Design(polyvander2d(x, a, mu_degrees), polyvander2d(x, a, sigma_degrees))
    law = maximize_likelihood(samples.residual, columns, pseudo_samples=pseudo_samples, minimum=samples.minimum_sigma)
    sigma = law.spread.reshape(sigma_degrees[0] + 1, sigma_degrees[1] + 1, 1)
    mu = law.mean.reshape(mu_degrees[0] + 1, mu_degrees[1] + 1, 1)
    minimum = minimum_sigma(np.maximum(columns.spread @ law.spread, samples.minimum_sigma))
    return Polynomials(sigma, mu, distances, amplitudes, minimum)


def subsampled(samples: Samples) -> Samples:
    """Samples, at most `MAX_SAMPLES` of them, drawn at random with a fixed seed."""
    if len(samples) <= MAX_SAMPLES:
        return samples
    return samples.take(np.random.default_rng(0).choice(len(samples), MAX_SAMPLES, replace=False))


def minimum_sigma(sigma: NDArray[np.floating]) -> float:
    """Lower bound for a fitted deviation where the domain holds no samples [m]."""
    return max(float(np.quantile(sigma, 0.005)), 1e-6)


def table(coefficients: NDArray[np.floating]) -> Table:
    """Coefficients (i, j) as nested tuples, as in a rig file."""
    return tuple(tuple(row) for row in coefficients.tolist())


def _spread_of(residual: NDArray[np.floating]) -> float:
    """Robust standard deviation [m], from the median absolute deviation; always positive."""
    size = np.abs(residual - np.median(residual))
    return float(max(np.median(size) * MAD_TO_SIGMA, size.mean() * 1e-3, 1e-9))


def _check_variety(columns: NDArray[np.floating]) -> None:
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)  # of zeros, zeros
    if columns.shape[1] and np.linalg.svd(scaled, compute_uv=False)[-1] < _MIN_VARIETY:
        raise NoiseError(
            f"the samples vary too little to tell {columns.shape[1]} coefficients apart; "
            "measure at more distances and on more materials, or ask for lower powers"
        )


def _solved(columns: NDArray[np.floating], triangle: NDArray[np.floating]) -> NDArray[np.floating]:
    """Design matrix (g, k) in the basis in which the samples' columns are orthogonal; g may be 0."""
    return np.linalg.solve(triangle.T, columns.reshape(len(columns), len(triangle)).T).T


def _bounded(
    v: NDArray[np.floating], minimum: float | NDArray[np.floating]
) -> tuple[NDArray[np.floating], NDArray[np.bool_]]:
    """Clamped power of the deviation, and the mask of values that were not clamped."""
    return np.maximum(v, minimum), v > minimum


def _start(samples: ResidualSamples) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Initial parameters by least squares with clipped residuals; constant spread if a linear one would be negative."""
    r, (mean, spread), power = samples.residual, samples.columns, samples.power
    middle = np.median(r) if mean.shape[1] else 0.0
    offset = mean.T @ np.clip(r, middle - 5, middle + 5)
    size = np.minimum(np.abs(r - mean @ offset) * np.sqrt(np.pi / 2), 5)
    size = np.maximum(size, 1.5 * samples.minimum) ** power  # where bounds hold, likelihood has no slope
    linear = spread.T @ size
    constant = spread.T @ np.full(len(r), size.mean())
    return offset, linear if (spread @ linear).min() > _MIN_SPREAD**power else constant
