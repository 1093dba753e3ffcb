"""Probability of no return: how often a depth sensor delivers no distance for a pixel that shows a surface."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import scipy  # its parts are imported when they are first used
from annotated_types import Interval
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class NoReturn:
    """log(p / (1 − p)) = log(share / (1 − share)) + per_m (x − 1 m) + grazing (1 − cos α).

    p is the probability of no return, x the distance of the surface [m], α the angle of incidence. The logistic law
    keeps p between 0 and 1 at any distance and angle. It is a property of the sensor beside its noise model, so that it
    is the same law for all of them. A missing return has no amplitude, so p does not depend on it.

    Attributes:
        share: probability of no return from a surface that faces the sensor at 1 m.
        per_m: growth of the log-odds per metre [1/m].
        grazing: growth of the log-odds from a surface that faces the sensor to one that is seen edge on.
    """

    share: Annotated[float, Interval(gt=0, lt=1)] = 0.05
    per_m: Annotated[float, Interval(ge=-20, le=20)] = 0.0
    grazing: Annotated[float, Interval(ge=0, le=20)] = 0.0

    @property
    def coefficients(self) -> tuple[float, float, float]:
        """Log-odds of a surface that faces the sensor at 1 m, and their growth with the distance and with the angle."""
        return float(scipy.special.logit(self.share)), float(self.per_m), float(self.grazing)

    def log_odds(self, x: ArrayLike, cosine: ArrayLike) -> NDArray[np.float64]:
        """Logarithm of p / (1 − p) at distances `x` [m] and cosines of incidence, in their common shape."""
        facing, per_m, grazing = self.coefficients
        return facing + per_m * (np.asarray(x, np.float64) - 1) + grazing * (1 - np.asarray(cosine, np.float64))

    def probability(self, x: ArrayLike, cosine: ArrayLike) -> NDArray[np.float64]:
        """Probability p of no return, in the common shape of distances [m] and cosines of incidence."""
        return scipy.special.expit(self.log_odds(x, cosine))


Settings = NoReturn

#: Of a sensor about which nothing is known: its missing returns count little.
CAUTIOUS = NoReturn()

#: Of a sensor that returns whatever is there: a missing return costs as much as an outlier.
NEVER = NoReturn(share=1e-12)

#: Standard deviations of the log-odds, their growth per metre and towards grazing, before anything is measured: the
#: share within a factor of seven, and a sensor that loses nearly everything that it sees edge on.
_PRIOR = np.array([2.0, 1.0, 3.0])

#: Limits of the same.
_LIMITS = ((-20.0, 20.0), (-20.0, 20.0), (0.0, 20.0))


def fit(
    x: NDArray[np.float64], cosine: NDArray[np.float64], missing: NDArray[np.float64], weight: NDArray[np.float64]
) -> NoReturn:
    """Law of largest posterior density: logistic regression with a Gaussian prior around the default.

    What the samples leave open, such as the growth with the distance if all have one, stays as it is by default. Where
    nothing was missing, the prior keeps the share above 0, as about half a count would.

    Args:
        x: distances of surfaces (n,) [m].
        cosine: their cosines of incidence (n,).
        missing: share of their returns that are missing (n,).
        weight: number of independent returns that each share stands for (n,).
    """
    columns = np.column_stack([np.ones_like(x), x - 1, 1 - cosine])
    center = np.array([scipy.special.logit(CAUTIOUS.share), CAUTIOUS.per_m, CAUTIOUS.grazing])

    def cost(theta: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        odds, off = columns @ theta, (theta - center) / _PRIOR
        value = np.sum(weight * (np.logaddexp(0, odds) - missing * odds)) + 0.5 * off @ off
        return float(value), columns.T @ (weight * (scipy.special.expit(odds) - missing)) + off / _PRIOR

    options = {"ftol": 1e-12}
    found = scipy.optimize.minimize(cost, center, jac=True, method="L-BFGS-B", bounds=_LIMITS, options=options).x
    return NoReturn(float(scipy.special.expit(found[0])), float(found[1]), float(found[2]))
