"""A board whose ends are out of sight, one that its ends hold, and an outline that holds for the moment."""

from dataclasses import replace

import numpy as np
import pytest

import abs_service as a
from abs_service.tracker.posterior.covariance.slides import Slides
from abs_service.tracker.posterior.priors.change_metric import ChangeMetric
from abs_service.tracker.posterior.priors.motion_prediction import MotionPrediction
from abs_service.tracker.posterior.priors.settings import Settings
from abs_service.tracker.posterior.slide_drift import IN_A_ROW, SlideDrift
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


PREDICTION = MotionPrediction(
    np.zeros(2), np.inf, 1 / 30, False, ChangeMetric(np.ones(2), np.zeros((0, 2))), Settings()
)
#: Of 1 mm, in all directions but one, along which nothing tells where the surface is.
HELD = np.array([1e6, 1e6, 0.0, 1e6, 1e6, 1e6])
ADRIFT = Slides(np.inf, HELD, np.zeros(6), np.eye(6), np.eye(4, 3), 0.1)
HELD_AGAIN = HELD + 0.9e6 * (HELD == 0)
BY_OUTLINE = replace(ADRIFT, held=HELD_AGAIN, by_outline=HELD_AGAIN - HELD)


def deviations(frames: list[Slides]) -> list[float]:
    """Deviations along the slide [m] that are believed in each frame."""
    drift = SlideDrift()
    return [drift.update(slides, PREDICTION).slides.deviation_m for slides in frames]


def test_after_a_long_drift_an_outline_holds_a_surface_that_it_holds_in_many_frames():
    """A rolled sheet's silhouette was taken for its end in single frames: TRACKING with 1 mm, 20 mm off."""
    found = deviations([*[ADRIFT] * 12, BY_OUTLINE, *[ADRIFT] * 2, *[BY_OUTLINE] * IN_A_ROW])
    assert np.isclose(found[:-1], 1.0).all()
    assert found[-1] == pytest.approx(1e-3, rel=0.1)


@pytest.mark.parametrize("frames", [[ADRIFT] * 12 + [replace(ADRIFT, held=HELD_AGAIN)], [ADRIFT, BY_OUTLINE]])
def test_a_print_holds_at_once_and_an_outline_does_after_a_moment(frames: list[Slides]):
    assert deviations(frames)[-1] == pytest.approx(1e-3, rel=0.1)
