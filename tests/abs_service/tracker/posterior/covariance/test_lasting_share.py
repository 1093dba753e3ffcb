"""Share of a residual's variance that is the same in all frames."""

from collections.abc import Callable

import numpy as np
import pytest

from abs_service.tracker.models.base import SparseJacobian
from abs_service.tracker.posterior.covariance.error_propagation import LASTING, LastingShares
from abs_service.tracker.terms.linearization import Linearization, PointLinearization

POINTS = 300
SPARSE = SparseJacobian.from_dense(np.zeros((POINTS, 3, 2)))


def at(points: np.ndarray, residual: np.ndarray) -> PointLinearization:
    """Residuals at some points."""
    return PointLinearization(residual, np.zeros((len(points), 3)), points, SPARSE, np.zeros((POINTS, 3)))


def share(draw: Callable[[np.random.Generator], PointLinearization], frames: int = 80) -> float:
    """Lasting share after some frames of residuals draw(generator)."""
    generator, shares, found = np.random.default_rng(7), LastingShares(), np.zeros(1)
    for _ in range(frames):
        found = shares.update([draw(generator)])
    return float(found[0])


@pytest.mark.parametrize("lasting", [0.0, 0.3, 0.8])
def test_it_is_the_share_of_the_noise_that_all_frames_have_in_common(lasting):
    """A tenth of the points, another one in every frame, has no inlier."""
    same = np.sqrt(lasting) * np.random.default_rng(8).standard_normal(POINTS)

    def draw(generator: np.random.Generator) -> PointLinearization:
        points = np.sort(generator.permutation(POINTS)[: POINTS * 9 // 10])
        return at(points, same[points] + np.sqrt(1 - lasting) * generator.standard_normal(len(points)))

    assert share(draw) == pytest.approx(lasting, abs=0.06)


def test_channels_of_a_point_count_together():
    """Three values of every point, of which a third of the variance is that of the first frame."""
    same, points = np.random.default_rng(9).standard_normal(3 * POINTS), np.arange(POINTS).repeat(3)
    found = share(lambda generator: at(points, same + np.sqrt(2) * generator.standard_normal(3 * POINTS)))
    assert found == pytest.approx(1 / 3, abs=0.06)


def test_residuals_that_begin_or_have_no_points_have_the_share_of_a_first_frame():
    shares, residual = LastingShares(), np.ones(POINTS)
    edges = Linearization(np.ones(4), np.ones((4, 2)))
    first = shares.update([at(np.arange(POINTS), residual), edges])
    np.testing.assert_array_equal(first, LASTING)
    later = shares.update([at(np.arange(POINTS), residual), edges])
    assert LASTING < later[0] < 1
    assert later[1] == LASTING


def test_opposite_residuals_last_no_less_than_not_at_all():
    sign = iter(np.tile([1.0, -1.0], 40))
    assert share(lambda generator: at(np.arange(POINTS), next(sign) * np.ones(POINTS))) == 0


def test_a_sensor_that_comes_begins_anew():
    shares, part = LastingShares(), at(np.arange(POINTS), np.ones(POINTS))
    for _ in range(5):
        shares.update([part])
    np.testing.assert_array_equal(shares.update([part, part]), LASTING)
