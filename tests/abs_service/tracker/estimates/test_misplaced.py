"""Status of a mesh whose free edges lie off the outline."""

from dataclasses import replace

import pytest

from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.estimates.status import judge
from abs_service.tracker.terms.sensor_fit import Remainder
from abs_service.tracker.terms.vertex_counts import VertexCounts
from tests.abs_service.tracker.estimates.test_status import SETTINGS, SHAPE, fit, on_the_rim, seen


def test_a_mesh_off_its_outline_is_degraded():
    assert judge([on_the_rim(visible=60, outside=8, inside=8)], (), SHAPE, 0.0, SETTINGS)[0] == Status.TRACKING
    status, reasons = judge([on_the_rim(visible=60, outside=15, inside=9)], (), SHAPE, 0.0, SETTINGS)
    assert (status, len(reasons)) == (Status.DEGRADED, 1)
    assert reasons[0].startswith("40% of the free edges lie off the object's outline")
    assert "slid or turned" in reasons[0]
    (reason,) = judge([on_the_rim(visible=60, outside=2, inside=22)], (), SHAPE, 0.0, SETTINGS)[1]
    assert "nearly all of these end inside it" in reason, "the top of a box that is seen from above now"
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
    expected = "18% of the free edges lie off the object's outline, by 6 mm together"
    assert [one[: len(expected)] for one in reasons] == ([expected] if status == Status.DEGRADED else [])


def test_a_side_that_hangs_over_by_an_unknown_distance_degrades_an_estimate():
    shape = replace(SHAPE, deviation_m=14e-3)
    found, reasons = judge([on_the_rim(visible=60, off_m=float("inf"))], (), shape, 0.0, SETTINGS)
    assert found == Status.DEGRADED
    assert [reason.partition(":")[0] for reason in reasons] == [
        "a side that the first image did not show to its end hangs over that end, by an unknown distance"
    ], "it was said of 0% of the free edges"


@pytest.mark.parametrize(
    ("agreeing", "deviation_m", "outside", "status"),
    [
        (95, 0.9e-3, 0, Status.TRACKING),
        (95, 0.9e-3, 6, Status.DEGRADED),  # it hangs over at the other side: it has slid
        (85, 0.9e-3, 0, Status.DEGRADED),
        (95, 1.1e-3, 0, Status.DEGRADED),  # a plain surface agrees wherever it is, and its noise seems to hold it
    ],
)
def test_an_arm_against_the_edges_of_a_print_is_no_slide(agreeing, deviation_m, outside, status):
    colors = replace(seen(agreeing=agreeing, disagreeing=100 - agreeing), sensor="color")
    distances = replace(on_the_rim(visible=60, inside=22, outside=outside, off_m=0.04), remainder=Remainder(0.1, 0.1))
    shape = replace(SHAPE, no_outline_deviation_m=deviation_m)
    assert judge([distances, colors], (), shape, 0.0, SETTINGS)[0] == status


@pytest.mark.parametrize(
    ("agreeing", "deviation_m", "rim", "lost", "status"),
    [
        (95, 0.9e-3, {"outside": 40, "lost": 40}, 11, Status.TRACKING),
        (95, 0.9e-3, {"outside": 40, "lost": 40}, 10, Status.DEGRADED),  # as many have another colour: a slide
        (95, 0.9e-3, {"outside": 40, "lost": 25}, 50, Status.DEGRADED),  # others hang over a background
        (95, 0.9e-3, {"outside": 30, "lost": 30, "inside": 10}, 50, Status.DEGRADED),  # it has slid
        (85, 0.9e-3, {"outside": 40, "lost": 40}, 50, Status.DEGRADED),
        (95, 1.1e-3, {"outside": 40, "lost": 40}, 50, Status.DEGRADED),  # a plain surface
    ],
)
def test_returns_that_are_lost_at_the_edges_of_a_print_are_no_slide(agreeing, deviation_m, rim, lost, status):
    colors = replace(seen(agreeing=agreeing, disagreeing=100 - agreeing), sensor="color")
    counts = VertexCounts(facing=100, agreeing=100 - lost, disagreeing=lost)
    distances = replace(on_the_rim(visible=60, off_m=0.01, **rim), counts=counts, remainder=Remainder(0.1, 0.1))
    shape = replace(SHAPE, no_outline_deviation_m=deviation_m)
    assert judge([distances, colors], (), shape, 0.0, SETTINGS)[0] == status
