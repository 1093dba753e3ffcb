"""Every sensor may have a share of outliers and a range of its own; the objective's hold for the others."""

import numpy as np
import pytest

from abs_service.tracker.objectives import likelihood
from abs_service.tracker.terms.base import Bounds
from calib.noise.constant import Constant
from calib.noise.images.color import GaussianColor
from calib.rig import Sensor
from tests.abs_service.tracker.scenes import CAMERA

DEFAULT = likelihood.Settings(outlier_share=0.05, range_m=5.0)


def expected(share: float, uniform: float) -> Bounds:
    """Costs of (1 − ε) times a density, of a uniform density, and of ε times it."""
    return Bounds(-np.log(1 - share), -np.log(uniform), -np.log(share * uniform))


@pytest.mark.parametrize(
    ("own", "share", "range_m"),
    [
        ({}, 0.05, 5.0),
        ({"outlier_share": 0.3}, 0.3, 5.0),
        ({"range_m": 8.0}, 0.05, 8.0),
        ({"outlier_share": 0.01, "range_m": 0.5}, 0.01, 0.5),
    ],
)
def test_a_depth_sensor_s_own_go_before_the_objective_s(own, share, range_m):
    noise = Constant(5e-3)
    mine, other = DEFAULT.bounds(Sensor("mine", CAMERA, noise, **own)), DEFAULT.bounds(Sensor("other", CAMERA, noise))
    for found, wanted in ((mine, expected(share, 1 / range_m)), (other, expected(0.05, 1 / 5.0))):
        np.testing.assert_allclose(
            (found.inlier, found.uniform, found.outlier), (wanted.inlier, wanted.uniform, wanted.outlier)
        )


def test_a_color_sensor_may_have_a_share_of_its_own_and_is_uniform_over_its_levels():
    found = DEFAULT.bounds(Sensor("color", CAMERA, GaussianColor(), outlier_share=0.2))
    wanted = expected(0.2, 256.0**-3)
    np.testing.assert_allclose(
        (found.inlier, found.uniform, found.outlier), (wanted.inlier, wanted.uniform, wanted.outlier)
    )
