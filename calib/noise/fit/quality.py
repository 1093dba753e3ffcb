"""How well a noise model says what a sensor does: likelihood and coverage of samples that it was not fitted to."""

from dataclasses import dataclass

import numpy as np

from calib.noise.base import DepthNoise, log_density
from calib.noise.fit.fitting import RANGE_M
from calib.noise.fit.samples import Samples
from calib.noise.fit.truncation import deviation_within

#: Residuals of more deviations than this say nothing about the variance.
CUT = 3.0

#: Deviations within which 95 % of a normal distribution lie.
_DEVIATIONS_95 = 1.959964

#: A model that explains less than half of the samples is no model of them.
_MOST_OUTLIERS = 0.5

#: Share of the samples for which expectation and maximisation of the outliers' share have come to rest.
_SETTLED = 1e-6


@dataclass(frozen=True, slots=True)
class Quality:
    """A noise model's agreement with samples.

    Attributes:
        log_likelihood: mean logarithm of the density of a sample, outliers mixed in; larger is better.
        outlier_share: share of the samples that a uniform density explains better, by maximum likelihood; 0.5 at
            most.
        variance: of the residuals over their deviations, from those within three; 1 if the model is right, NaN if it
            explains no sample.
        within_one: share within one deviation, outliers aside; 0.683 if the model is right.
        within_95: share within 1.96 deviations, outliers aside; 0.95 if the model is right.
    """

    log_likelihood: float
    outlier_share: float
    variance: float
    within_one: float
    within_95: float


def judge(model: DepthNoise, samples: Samples) -> Quality:
    """Compares a model with samples, best with such as it was not fitted to.

    Raises:
        NoiseError: no sample has a distance or, where the model depends on it, an amplitude.
    """
    samples = samples.returns(with_amplitude=model.uses_amplitude)
    x, a, p = samples.true, samples.amplitude, samples.pixels
    density = np.exp(log_density(model, samples.measured, x, a, p))
    share, previous = 0.02, 1.0
    inlier = np.ones_like(density)
    while abs(share - previous) > _SETTLED:
        inlier = (1 - share) * density / ((1 - share) * density + share / RANGE_M)
        previous, share = share, min(float(1 - inlier.mean()), _MOST_OUTLIERS)
    z = (samples.residual - model.mean(x, a, p)) / model.deviation(x, a, p)
    near, total = z[np.abs(z) < CUT], max(float(inlier.sum()), 1e-9)
    return Quality(
        log_likelihood=float(np.log((1 - share) * density + share / RANGE_M).mean()),
        outlier_share=share,
        variance=deviation_within(float(np.mean(near**2)) if near.size else np.nan, CUT) ** 2,
        within_one=float(inlier[np.abs(z) < 1].sum() / total),
        within_95=float(inlier[np.abs(z) < _DEVIATIONS_95].sum() / total),
    )
