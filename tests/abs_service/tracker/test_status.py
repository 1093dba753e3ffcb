"""Status of an estimate, with its reasons."""

from dataclasses import replace

import pytest

from abs_service.tracker.estimate import Status
from abs_service.tracker.shape_quality import ShapeQuality
from abs_service.tracker.status import Settings, judge
from abs_service.tracker.terms.base import RimFit, SensorFit

SETTINGS = Settings(degraded_below=0.6, lost_below=0.3)
SHAPE = ShapeQuality(stretch=0.01, folded_share=0.0, deviation_m=1e-3)


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
    assert judge([fit(share)], missing, SHAPE, 0.0, SETTINGS) == (status, reasons)


def test_a_lost_object_names_every_reason():
    status, reasons = judge([fit(0.1)], ("color",), SHAPE, 0.0, SETTINGS)
    assert status == Status.LOST
    assert len(reasons) == 2


def test_a_mostly_hidden_object_is_degraded_even_if_the_rest_agrees():
    assert judge([fit(1.0, 0.5)], (), SHAPE, 0.0, SETTINGS) == (Status.TRACKING, ())
    reason = "62% of the vertices are occluded in the sensor that sees most of them"
    assert judge([fit(1.0, 0.62), fit(1.0, 0.9)], (), SHAPE, 0.0, SETTINGS) == (Status.DEGRADED, (reason,))


def on_the_rim(**rim: int) -> SensorFit:
    return replace(fit(1.0), rim=RimFit(**rim))


def test_a_mesh_off_its_outline_is_degraded():
    assert judge([on_the_rim(visible=60, outside=8, inside=8)], (), SHAPE, 0.0, SETTINGS)[0] == Status.TRACKING
    status, reasons = judge([on_the_rim(visible=60, outside=15, inside=9)], (), SHAPE, 0.0, SETTINGS)
    assert (status, len(reasons)) == (Status.DEGRADED, 1)
    assert reasons[0].startswith("40% of the free edges lie off the object's outline")
    few = [on_the_rim(visible=4, outside=4), fit(1.0)]
    assert judge(few, (), SHAPE, 0.0, SETTINGS)[0] == Status.TRACKING


@pytest.mark.parametrize(
    ("off_m", "claimed_m", "status"),
    [
        (0.004, 1e-3, Status.TRACKING),  # below the least distance
        (0.006, 1e-3, Status.DEGRADED),
        (0.006, 7e-3, Status.TRACKING),  # it is as uncertain
        (0.006, float("nan"), Status.DEGRADED),
    ],
)
def test_edges_farther_off_the_outline_than_the_covariances_claim_degrade_an_estimate(off_m, claimed_m, status):
    shape = replace(SHAPE, deviation_m=claimed_m)
    found, reasons = judge([on_the_rim(visible=60, inside=11, off_m=off_m)], (), shape, 0.0, SETTINGS)
    assert found == status
    assert [one[:20] for one in reasons] == (["18% of the free edge"] if status == Status.DEGRADED else [])


def test_an_estimate_that_the_motion_prior_has_held_back_is_degraded():
    assert judge([fit(1.0)], (), SHAPE, 1.9, SETTINGS) == (Status.TRACKING, ())
    status, reasons = judge([fit(1.0)], (), SHAPE, 2.8, SETTINGS)
    assert status == Status.DEGRADED
    assert reasons[0].startswith("the object moved 2.8 times as far from where it was expected")


def test_a_folded_mesh_and_one_that_nothing_holds_are_degraded():
    folded = ShapeQuality(stretch=0.1, folded_share=0.1, deviation_m=1e-3)
    assert judge([fit(1.0)], (), folded, 0.0, SETTINGS)[1] == (
        "10% of the faces are folded: the model cannot follow the shape",
    )
    loose = ShapeQuality(stretch=0.01, folded_share=0.0, deviation_m=0.02)
    status, reasons = judge([fit(1.0)], (), loose, 0.0, SETTINGS)
    assert status == Status.DEGRADED
    assert reasons[0].startswith("nothing holds the surface along itself, vertices are known to 20 mm so far")
    unheld = ShapeQuality(stretch=0.01, folded_share=0.0, deviation_m=1e-3, unheld_m=0.2)
    assert judge([fit(1.0)], (), unheld, 0.0, SETTINGS)[0] == Status.DEGRADED
