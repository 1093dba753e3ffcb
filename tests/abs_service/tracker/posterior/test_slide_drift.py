"""A board whose ends are out of sight, and one that its ends hold."""

import numpy as np
import pytest

import abs_service as a
from calib.camera import Camera

CAMERA = Camera(320, 240, 290.0, 290.0, 159.5, 119.5)


@pytest.mark.parametrize(("half_length_m", "minimum_mm", "maximum_mm"), [(1.0, 40.0, 120.0), (0.2, 0.0, 3.0)])
def test_a_board_that_nothing_holds_along_itself_may_be_farther_off_with_every_frame(
    half_length_m: float, minimum_mm: float, maximum_mm: float
):
    """By depth alone it may move as the motion prior allows for; it ended at 8 to 10 mm."""
    generator, rays = np.random.default_rng(0), CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = 0.7 * rays[..., 0] / rays[..., 2], 0.7 * rays[..., 1] / rays[..., 2]
    tracker, deviations = a.Tracker(CAMERA, a.Nurbs()), []
    for k in range(9):
        noise, frayed = generator.standard_normal((2, *x.shape))
        on = (np.abs(x) < half_length_m) & (np.abs(y) < 0.07 + 0.002 * frayed)
        distance = np.where(on, 0.7 + 0.1 * x**2, 1.2) + 0.001 * noise
        variance = tracker.track(distance, time_s=k / 30, mask=on).vertex_covariance
        deviations.append(1e3 * np.sqrt(np.median(np.diagonal(variance, axis1=1, axis2=2), axis=0)))
    along, across = deviations[-1][:2]
    assert minimum_mm < along < maximum_mm
    assert across < 3.0, "the long edges hold it"
    assert deviations[0][0] < 3.0, "the first frame defines where it is"
