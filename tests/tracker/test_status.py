"""When an estimate is to be trusted."""

import pytest

from abs_service.tracker.estimate import Status
from abs_service.tracker.status import Settings, judge
from abs_service.tracker.terms.base import SensorFit

SETTINGS = Settings(degraded_below=0.6, lost_below=0.3)


def fit(inliers: float, occluded: float = 0.0) -> SensorFit:
    """A sensor in which shares of 10 000 vertices are occluded, and of the others inliers."""
    visible = round(10_000 * (1 - occluded))
    return SensorFit("tof", visible, 10_000 - visible, visible, round(inliers * visible), 0.0, 1.0)


@pytest.mark.parametrize(
    ("share", "missing", "status", "reasons"),
    [
        (1.0, (), Status.TRACKING, ()),
        (0.6, (), Status.TRACKING, ()),
        (0.59, (), Status.DEGRADED, ("only 59% of the visible vertices agree with a measurement",)),
        (0.3, (), Status.DEGRADED, ("only 30% of the visible vertices agree with a measurement",)),
        (0.29, (), Status.LOST, ("only 29% of the visible vertices agree with a measurement",)),
        (0.0, (), Status.LOST, ("only 0% of the visible vertices agree with a measurement",)),
        (1.0, ("color",), Status.DEGRADED, ("no frame from color",)),
        (1.0, ("a", "b"), Status.DEGRADED, ("no frame from a", "no frame from b")),
    ],
)
def test_status_and_reasons(share, missing, status, reasons):
    assert judge([fit(share)], missing, SETTINGS) == (status, reasons)


def test_a_lost_object_names_every_reason():
    status, reasons = judge([fit(0.1)], ("color",), SETTINGS)
    assert status == Status.LOST
    assert len(reasons) == 2


def test_a_mostly_hidden_object_is_degraded_even_if_the_rest_agrees():
    assert judge([fit(1.0, 0.5)], (), SETTINGS) == (Status.TRACKING, ())
    reason = "62% of the vertices are occluded in the sensor that sees most of them"
    assert judge([fit(1.0, 0.62), fit(1.0, 0.9)], (), SETTINGS) == (Status.DEGRADED, (reason,))
