"""The deviation of all residuals is estimated from those within a cut, without bias, whatever the outliers."""

import numpy as np
import pytest

from calib.noise.fit.truncation import deviation_within


def estimated(residuals: np.ndarray, cut: float = 3.0) -> float:
    """The deviation from residuals (n, channels), of which the root mean square is cut."""
    size = np.sqrt(np.mean(residuals**2, axis=1))
    return deviation_within(float(np.mean(size[size < cut] ** 2)), cut, residuals.shape[1])


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("deviation", [0.1, 0.5, 1.0, 1.5, 2.0, 3.0])
def test_it_is_that_of_the_normal_distribution_that_was_cut(deviation, channels):
    residuals = deviation * np.random.default_rng(1).standard_normal((400_000, channels))
    assert estimated(residuals) == pytest.approx(deviation, rel=0.02)


def test_what_lies_beyond_does_not_count():
    generator = np.random.default_rng(2)
    residuals = generator.standard_normal((100_000, 1))
    residuals[:20_000] = generator.choice([-1, 1], (20_000, 1)) * generator.uniform(3, 1000, (20_000, 1))
    assert estimated(residuals) == pytest.approx(1, abs=0.01)


def test_it_ends_where_nothing_can_be_told_any_more():
    spread = np.random.default_rng(3).uniform(-1000, 1000, (1_000_000, 1))
    assert 3 < estimated(spread) <= 4.5
    assert deviation_within(9.0, 3.0) == 4.5


def test_nothing_is_nothing():
    assert deviation_within(0.0, 3.0) == 0
    assert np.isnan(deviation_within(float("nan"), 3.0))
