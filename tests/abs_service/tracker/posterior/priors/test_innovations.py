"""Statistics of innovations: noise of the estimates is told from motion that was not predicted."""

import numpy as np
import pytest

from abs_service.tracker.posterior.priors.innovations import Innovations

SHARE, INTERVAL_S, DIM = 0.7, 1 / 30, 30


def followed(motion: np.ndarray, noise: np.ndarray) -> Innovations:
    """Innovations of estimates (frames, dim) of a point that is displaced by `motion` more than predicted."""
    found = Innovations(DIM)
    for t in range(2, len(noise)):
        repeated = noise[t] - (1 + SHARE) * noise[t - 1] + SHARE * noise[t - 2]
        found.update(motion[t] + repeated, np.zeros(DIM), DIM, INTERVAL_S)
    return found


@pytest.mark.parametrize(("motion", "noise"), [(1.0, 0.0), (0.0, 1.0), (1.0, 0.5)])
def test_the_noise_of_the_estimates_is_no_motion(motion, noise):
    generator = np.random.default_rng(0)
    frames = generator.standard_normal((2, 600, DIM))
    found = followed(motion * frames[0], noise * frames[1])
    assert found.motion_variance == pytest.approx(motion**2, abs=0.25)
    assert found.variance == pytest.approx(motion**2 + noise**2 * (1 + 1.7**2 + 0.7**2), rel=0.15)


def test_a_motion_that_goes_on_is_counted_once():
    found = followed(np.ones((600, DIM)), np.zeros((600, DIM)))
    assert found.motion_variance == found.variance == pytest.approx(1)
