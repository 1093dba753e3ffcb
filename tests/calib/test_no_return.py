"""The probability of no return: its law, and what is learnt of it from planes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from calib import no_return
from calib.no_return import CAUTIOUS, NoReturn


@settings(max_examples=50, deadline=None)
@given(
    st.builds(NoReturn, st.floats(1e-6, 0.999), st.floats(-20, 20), st.floats(0, 20)),
    st.floats(0.1, 10),
    st.floats(0, 1),
)
def test_the_probability_is_that_of_the_log_odds_and_grows_towards_grazing(law, x, cosine):
    p = float(law.probability(x, cosine))
    assert 0 <= p <= 1
    assert float(law.probability(1.0, 1.0)) == pytest.approx(law.share)
    assert float(law.probability(x, 0.5 * cosine)) >= p
    if 1e-9 < p < 1 - 1e-9:
        assert np.log(p / (1 - p)) == pytest.approx(float(law.log_odds(x, cosine)), rel=1e-4, abs=1e-4)


def boards(probability, seed: int = 1, pixels: int = 400, frames: int = 30):
    """Shares of missing returns of boards at five distances and four angles, of a sensor of another law."""
    generator = np.random.default_rng(seed)
    x, angle = (part.ravel() for part in np.meshgrid([0.6, 0.9, 1.2, 1.6, 2.0], np.radians([0, 25, 50, 70])))
    x, cosine = np.repeat(x, pixels), np.repeat(np.cos(angle), pixels)
    missing = generator.binomial(frames, probability(x, cosine)) / frames
    return x, cosine, missing, np.full(len(x), 100 / pixels)


def test_a_sensor_s_own_law_is_found_from_boards():
    """A probit of the light that returns: no logistic law, but one is near it where boards were seen."""

    def probability(x: np.ndarray, cosine: np.ndarray) -> np.ndarray:
        return norm.cdf(-1.2 - 0.6 * np.log(cosine / x**2))

    x, cosine, missing, weight = boards(probability)
    law = no_return.fit(x, cosine, missing, weight)
    assert law.per_m > 0.3
    assert law.grazing > 0.5
    error = law.probability(x, cosine) - probability(x, cosine)
    assert np.sqrt(np.mean(error**2)) < 0.03
    assert np.sqrt(np.mean((CAUTIOUS.probability(x, cosine) - probability(x, cosine)) ** 2)) > 0.1


def test_what_is_not_seen_stays_as_it_is_by_default():
    x, cosine, missing, weight = boards(lambda x, cosine: np.full_like(x, 0.3))
    one = (x == 0.9) & (cosine == 1)
    law = no_return.fit(np.ones(one.sum()), cosine[one], missing[one], weight[one])
    assert law.share == pytest.approx(0.3, abs=0.03)
    assert (law.per_m, law.grazing) == pytest.approx((CAUTIOUS.per_m, CAUTIOUS.grazing), abs=1e-3)
    nothing = np.zeros(0)
    assert no_return.fit(nothing, nothing, nothing, nothing).share == pytest.approx(CAUTIOUS.share)


def test_returns_that_were_never_missing_are_unlikely_to_be_and_not_impossible():
    x, cosine, missing, weight = boards(lambda x, cosine: np.zeros_like(x))
    law = no_return.fit(x, cosine, missing, weight)
    assert 1e-5 < law.share < 0.01
    assert law.grazing >= 0
