"""Maximum likelihood of a noise model's parameters, with a share of outliers that come from anywhere."""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.polynomial.polynomial import polyvander2d
from numpy.typing import NDArray

from calib.noise.base import LOG_SQRT_2PI
from calib.noise.polynomial import Polynomials, Table
from calib.noise.samples import Samples, domain

#: More samples than this are thinned at random: the parameters of a whole image need no more.
LARGEST = 200_000

#: Distances over which an outlier is uniform [m].
RANGE_M = 5.0

#: The deviation at which the fit stops, in units of the samples' spread: a sample that lies on the mean exactly would
#: be explained ever better by an ever smaller one.
_LEAST_SPREAD = 1e-3

#: σ of a normal distribution over its median absolute deviation.
MAD_TO_SIGMA = 1.4826


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


def maximize(
    residual: NDArray[np.floating], mean: NDArray[np.floating], spread: NDArray[np.floating], power: int = 1
) -> Law:
    """Fits (1 − ε) N(μ, σ²) + ε uniform to residuals, with μ = mean @ m and σᵖᵒʷᵉʳ = spread @ s.

    Args:
        residual: measured minus real distance (n,) [m].
        mean: columns (n, k); k may be 0, for no mean offset.
        spread: columns (n, l).
        power: 1 if the deviation is linear in its parameters, 2 if the variance is.
    """
    unit = _spread_of(residual)
    q_mean, r_mean = np.linalg.qr(mean)  # orthogonal columns, however different the powers of x and a are
    q_spread, r_spread = np.linalg.qr(spread)
    k, r, uniform = mean.shape[1], residual / unit, unit / RANGE_M

    def cost(parameters: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Negative mean log-likelihood and its gradient; the share ε is in its logit."""
        share = scipy.special.expit(parameters[-1])
        v = np.maximum(q_spread @ parameters[k:-1], _LEAST_SPREAD**power)
        sigma = v ** (1 / power)
        z = (r - q_mean @ parameters[:k]) / sigma
        normal = np.exp(-0.5 * z**2 - LOG_SQRT_2PI) / sigma
        density = (1 - share) * normal + share * uniform
        weight = (1 - share) * normal / density
        by_v = np.where(v > _LEAST_SPREAD**power, weight * (1 - z**2) / (power * v), 0)
        by_share = (normal - uniform) / density * share * (1 - share)
        gradient = np.concatenate([-q_mean.T @ (weight * z / sigma), q_spread.T @ by_v, [by_share.sum()]])
        return -float(np.log(density).mean()), gradient / len(r)

    start = np.concatenate([*_start(r, q_mean, q_spread, power), [scipy.special.logit(0.02)]])
    bounds = [(None, None)] * (len(start) - 1) + [tuple(scipy.special.logit([1e-6, 0.5]))]
    options = {"maxiter": 500, "ftol": 1e-12, "gtol": 1e-8}
    best = scipy.optimize.minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options).x
    return Law(
        np.linalg.solve(r_mean, best[:k]) * unit,
        np.linalg.solve(r_spread, best[k:-1]) * unit**power,
        float(scipy.special.expit(best[-1])),
    )


def polynomials(samples: Samples, sigma_degrees: tuple[int, int], mu_degrees: tuple[int, int]) -> Polynomials:
    """One pair of polynomials for all samples; σ is never less than nearly the least that they show.

    Args:
        samples: measurements; the domain is where they lie.
        sigma_degrees, mu_degrees: highest powers of the distance and of the amplitude.

    Raises:
        NoiseError: no sample has a distance or, where a power of the amplitude is asked for, an amplitude.
    """
    samples = thinned(samples.returns(with_amplitude=max(sigma_degrees[1], mu_degrees[1]) > 0))
    distances = domain(samples.true)
    amplitudes = domain(samples.amplitude) if np.isfinite(samples.amplitude).all() else (0.0, 65535.0)
    x, a = np.clip(samples.true, *distances), np.nan_to_num(np.clip(samples.amplitude, *amplitudes))
    law = maximize(samples.residual, polyvander2d(x, a, mu_degrees), polyvander2d(x, a, sigma_degrees))
    sigma = law.spread.reshape(sigma_degrees[0] + 1, sigma_degrees[1] + 1, 1)
    mu = law.mean.reshape(mu_degrees[0] + 1, mu_degrees[1] + 1, 1)
    least = least_sigma(polyvander2d(x, a, sigma_degrees) @ law.spread)
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


def _start(
    r: NDArray[np.floating], mean: NDArray[np.floating], spread: NDArray[np.floating], power: int
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Least squares without what is far off; orthogonal columns. A spread below zero somewhere begins as a constant."""
    middle = np.median(r) if mean.shape[1] else 0.0
    offset = mean.T @ np.clip(r, middle - 5, middle + 5)
    size = np.minimum(np.abs(r - mean @ offset) * np.sqrt(np.pi / 2), 5) ** power
    linear = spread.T @ size
    constant = spread.T @ np.full(len(r), size.mean())
    return offset, linear if (spread @ linear).min() > _LEAST_SPREAD**power else constant
