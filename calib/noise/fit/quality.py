"""Goodness of fit of a noise model: likelihood and coverage on held-out samples."""

from dataclasses import dataclass

import numpy as np

from calib.noise.base import DepthNoise, log_density
from calib.noise.fit.fitting import RANGE_M
from calib.noise.fit.samples import Samples
from calib.noise.fit.truncation import deviation_within

#: Residuals beyond this many deviations are excluded from the variance.
CUT = 3.0

#: 97.5 % quantile of the standard normal distribution: 95 % lie within ± this many deviations.
_DEVIATIONS_95 = 1.959964

#: Upper bound of the outlier fraction.
_MAX_OUTLIERS = 0.5

#: Convergence tolerance of the outlier fraction in expectation–maximisation.
_SETTLED = 1e-6


@dataclass(frozen=True, slots=True)
class Quality:
    """Agreement of a noise model with samples.

    Attributes:
        log_likelihood: mean log-density of a sample under the mixture with outliers; larger is better.
        outlier_share: maximum-likelihood fraction of outliers, at most 0.5.
        variance: of normalised residuals, from those within three deviations; 1 if the model is right, NaN if there are
            none.
        within_one: fraction of inliers within one deviation; 0.683 if the model is right.
        within_95: fraction of inliers within 1.96 deviations; 0.95 if the model is right.
    """

    log_likelihood: float
    outlier_share: float
    variance: float
    within_one: float
    within_95: float


def goodness_of_fit(model: DepthNoise, samples: Samples) -> Quality:
    """Agreement of a model with samples, preferably ones that it was not fitted to.

    Raises:
        NoiseError: no sample has a distance or, if the model uses it, an amplitude.
    """
    samples = samples.returns(with_amplitude=model.uses_amplitude)
    x, a, p = samples.true, samples.amplitude, samples.pixels
    density = np.exp(log_density(model, samples.measured, x, a, p))
    share, previous = 0.02, 1.0
    inlier = np.ones_like(density)
    while abs(share - previous) > _SETTLED:
        inlier = (1 - share) * density / ((1 - share) * density + share / RANGE_M)
        previous, share = share, min(float(1 - inlier.mean()), _MAX_OUTLIERS)
    z = (samples.residual - model.mean(x, a, p)) / model.deviation(x, a, p)
    near, total = z[np.abs(z) < CUT], max(float(inlier.sum()), 1e-9)
    return Quality(
        log_likelihood=float(np.log((1 - share) * density + share / RANGE_M).mean()),
        outlier_share=share,
        variance=deviation_within(float(np.mean(near**2)) if near.size else np.nan, CUT) ** 2,
        within_one=float(inlier[np.abs(z) < 1].sum() / total),
        within_95=float(inlier[np.abs(z) < _DEVIATIONS_95].sum() / total),
    )
