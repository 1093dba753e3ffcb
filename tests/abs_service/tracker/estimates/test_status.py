"""Status of an estimate, with its reasons."""

import re
from dataclasses import replace
from typing import Any

import pytest

from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.estimates.shape_quality import ShapeQuality
from abs_service.tracker.estimates.status import Settings, judge
from abs_service.tracker.terms.sensor_fit import Remainder, RimFit, SensorFit
from abs_service.tracker.terms.vertex_counts import VertexCounts

SETTINGS = Settings(degraded_below=0.6, lost_below=0.3)
SHAPE = ShapeQuality(stretch=0.01, folded_share=0.0, deviation_m=1e-3)


def fit(inliers: float, occluded: float = 0.0) -> SensorFit:
    """A sensor in which shares of 10 000 vertices are occluded, and of the others inliers."""
    visible = round(10_000 * (1 - occluded))
    return SensorFit("tof", visible, 10_000 - visible, visible, round(inliers * visible), 0.0, 1.0)


def facts(reasons: tuple[str, ...]) -> tuple[str, ...]:
    """The facts, without the advice."""
    return tuple(reason.partition(" – ")[0] for reason in reasons)


def seen(**counts: int) -> SensorFit:
    """A sensor that sees what it should see as it should be, but for 100 vertices with given classes."""
    return replace(fit(1.0), counts=VertexCounts(facing=100, **counts))


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
    found, said = judge([fit(share)], missing, SHAPE, 0.0, SETTINGS)
    assert (found, facts(said)) == (status, reasons)


def test_a_lost_object_names_every_reason():
    status, reasons = judge([fit(0.1)], ("color",), SHAPE, 0.0, SETTINGS)
    assert status == Status.LOST
    assert len(reasons) == 2


def test_without_any_measurement_the_cause_is_said_and_not_that_the_object_is_out_of_sight():
    status, reasons = judge([], ("tof", "color"), SHAPE, 0.0, SETTINGS)
    assert status == Status.LOST
    cause = "no sensor delivered all its images, so that nothing was measured"
    assert facts(reasons) == ("no frame from tof", "no frame from color", cause)


def test_a_mostly_hidden_object_is_degraded_even_if_the_rest_agrees():
    assert judge([fit(1.0, 0.5)], (), SHAPE, 0.0, SETTINGS) == (Status.TRACKING, ())
    reason = "62% of the vertices are occluded in the sensor that sees most of them"
    status, reasons = judge([fit(1.0, 0.62), fit(1.0, 0.9)], (), SHAPE, 0.0, SETTINGS)
    assert (status, facts(reasons)) == (Status.DEGRADED, (reason,))


@pytest.mark.parametrize(
    ("counts", "reason"),
    [
        ({"agreeing": 50, "missing": 50}, None),
        ({"agreeing": 40, "behind_itself": 60}, None),  # the object hides them, nothing is wrong
        ({"agreeing": 40, "disagreeing": 10}, None),  # half are not judged
        (
            {"agreeing": 45, "missing": 35, "outside": 20},
            ("45%", "35% of all have no return – bring the surface nearer"),
        ),
        (
            {"agreeing": 45, "missing": 15, "outside": 40},
            ("45%", "40% of all are outside the image – bring the object"),
        ),
        ({"agreeing": 30, "behind_occluder": 50}, ("38%", "50% of all are behind something – take it away")),
        ({"agreeing": 40, "disagreeing": 60}, ("40%", "60% of all disagree – take away what touches")),
    ],
)
def test_of_the_vertices_that_should_be_in_sight_half_have_to_agree_in_one_sensor(counts, reason):
    status, reasons = judge([seen(**counts)], (), SHAPE, 0.0, SETTINGS)
    assert status == (Status.DEGRADED if reason else Status.TRACKING)
    if reason:
        share, cause = reason
        assert reasons[0].startswith(f"only {share} of the vertices that should be in sight agree")
        assert cause in reasons[0]
    both = [seen(**counts), seen(agreeing=90, missing=10)]
    assert judge(both, (), SHAPE, 0.0, SETTINGS) == (Status.TRACKING, ())


def test_where_no_distance_is_measured_the_advice_is_not_that_for_a_mesh_that_disagrees():
    hole = replace(fit(0.5), counts=VertexCounts(facing=100, missing=96), remainder=Remainder(0.1, 0.1))
    status, reasons = judge([hole, replace(fit(0.5), sensor="color")], (), SHAPE, 0.0, SETTINGS)
    assert status == Status.DEGRADED
    assert reasons[0] == (
        "only 50% of the visible vertices agree with a measurement, 96% of all have no return – bring the surface "
        "nearer, or turn it towards the camera"
    )


def test_colors_of_an_object_that_left_the_depth_image_do_not_make_up_for_its_distances():
    """Those of a white table agree wherever it is."""
    colors = seen(agreeing=65, outside=35)
    near, far = (replace(seen(agreeing=k, outside=100 - k), remainder=Remainder(0.1, 0.1)) for k in (55, 45))
    assert judge([near, colors], (), SHAPE, 0.0, SETTINGS)[0] == Status.TRACKING
    assert judge([far, near, colors], (), SHAPE, 0.0, SETTINGS)[0] == Status.TRACKING
    status, reasons = judge([far, colors], (), SHAPE, 0.0, SETTINGS)
    assert status == Status.DEGRADED
    assert facts(reasons)[0].startswith("55% of the vertices that should be in sight are outside the depth image")
    hole = replace(seen(agreeing=45, missing=55), remainder=Remainder(0.1, 0.1))
    assert judge([hole, colors], (), SHAPE, 0.0, SETTINGS)[0] == Status.TRACKING


def test_measured_surface_beyond_the_mesh_degrades_an_estimate_unless_it_was_hidden_at_first():
    def beyond(share: float, **rim: int) -> SensorFit:
        return replace(on_the_rim(visible=60, **rim), remainder=Remainder(share, at_first=0.1))

    assert judge([beyond(0.34)], (), SHAPE, 0.0, SETTINGS) == (Status.TRACKING, ())
    status, reasons = judge([beyond(0.4)], (), SHAPE, 0.0, SETTINGS)
    assert status == Status.DEGRADED
    assert reasons[0].startswith("30% more of the measured surface continues beyond the mesh than at first")
    assert judge([beyond(0.4, covered=9, uncovered=8)], (), SHAPE, 0.0, SETTINGS) == (Status.TRACKING, ())
    assert judge([beyond(float("nan"))], (), SHAPE, 0.0, SETTINGS) == (Status.TRACKING, ())
    assert judge([beyond(0.4), beyond(0.1)], (), SHAPE, 0.0, SETTINGS) == (Status.TRACKING, ())


def test_every_reason_says_what_to_do():
    counts = VertexCounts(400, 10, 90, missing=300)
    nothing_right = SensorFit("tof", 100, 300, 100, 10, -1.0, 1.0, RimFit(20, 10, 10), counts, Remainder(0.9, 0.0))
    surprised = replace(nothing_right, remainder=Remainder(), is_surprised=True)
    out_of_sight = replace(nothing_right, inliers=100, occluded=50)
    cases = nothing_right, replace(nothing_right, inliers=50), out_of_sight, surprised
    bad = ShapeQuality(folded_share=0.5, deviation_m=1.0, single_frame_deviation_m=1.0)
    said = [judge([one], (), bad, 9.9, Settings()) for one in (*cases, replace(nothing_right, rim=RimFit(20, 0, 20)))]
    said += [judge([nothing_right], (), ShapeQuality(single_frame_deviation_m=1.0), 0.0, Settings())]
    reasons = {reason for _, some in said for reason in some}
    assert len(facts(tuple(reasons))) == 13
    assert [reason for reason in reasons if len(re.split(" – |: ", reason, maxsplit=1)[1]) < 20] == []
    assert all("it is looked for again" in some[0] for status, some in said if status == Status.LOST)


def on_the_rim(off_m: float = 0.0, **rim: Any) -> SensorFit:
    return replace(fit(1.0), rim=RimFit(off_m=off_m, **rim))


def test_an_estimate_that_the_motion_prior_has_held_back_is_degraded():
    assert judge([fit(1.0)], (), SHAPE, 1.9, SETTINGS) == (Status.TRACKING, ())
    status, reasons = judge([fit(1.0)], (), SHAPE, 2.8, SETTINGS)
    assert status == Status.DEGRADED
    assert reasons[0].startswith("the object moved 2.8 times as far from where it was expected")


def test_a_folded_mesh_and_one_that_nothing_holds_are_degraded():
    folded = ShapeQuality(stretch=0.1, folded_share=0.1, deviation_m=1e-3)
    (reason,) = facts(judge([fit(1.0)], (), folded, 0.0, SETTINGS)[1])
    assert reason == "10% of the faces are folded: the model cannot follow the shape"
    loose = {"vertices are known to 20 mm so far": replace(SHAPE, deviation_m=0.02)}
    loose["a single frame shows vertices to 200 mm only"] = replace(SHAPE, single_frame_deviation_m=0.2)
    for how_well, shape in loose.items():
        status, (reason,) = judge([fit(1.0)], (), shape, 0.0, SETTINGS)
        assert status == Status.DEGRADED
        assert reason.startswith(f"nothing holds the surface along itself, {how_well}")


def depth(name: str, agreeing: int, disagreeing: int, share: float = 0.0, surprised: bool = False) -> SensorFit:
    """A sensor of distances with 300 vertices; `share` of its surface is unexplained, NaN if it shows no object."""
    counts = VertexCounts(facing=300, agreeing=agreeing, disagreeing=disagreeing)
    return SensorFit(
        name, 300, 0, 300, agreeing, 0.0, 1.0, counts=counts, remainder=Remainder(share, 0.0), is_surprised=surprised
    )


def test_colors_that_agree_do_not_outvote_distances_that_do_not():
    colors = replace(fit(0.95), counts=VertexCounts(facing=10_000, agreeing=9_500, disagreeing=500))
    assert judge([depth("tof", 151, 149), colors], (), SHAPE, 0.0, SETTINGS) == (Status.TRACKING, ())
    status, reasons = judge([depth("tof", 115, 185), colors], (), SHAPE, 0.0, SETTINGS)
    assert (status, facts(reasons)) == (Status.DEGRADED, ("only 38% of the distances of tof agree",))
    beside = depth("tof", 0, 44, float("nan"))
    assert judge([beside, colors], (), SHAPE, 0.0, SETTINGS)[0] == Status.DEGRADED, "none of the object is on the mesh"
    assert judge([depth("tof", 5, 14), colors], (), SHAPE, 0.0, SETTINGS)[0] == Status.TRACKING, "too few say nothing"
    dark = replace(colors, counts=VertexCounts(facing=10_000, agreeing=4_000, disagreeing=6_000))
    lying = depth("tof", 300, 0)
    standing = replace(lying, rim=RimFit(visible=20))
    assert judge([standing, dark], (), SHAPE, 0.0, SETTINGS)[0] == Status.TRACKING, "a lamp went out"
    _, reasons = judge([lying, dark], (), SHAPE, 0.0, SETTINGS)
    assert facts(reasons) == ("only 40% of the colours of tof agree",), "no edge tells that it has not slid"


def test_distances_that_agree_do_not_outvote_colors_of_a_mesh_half_of_which_is_elsewhere_on_a_floor():
    half = replace(fit(0.95), sensor="rgb", counts=VertexCounts(facing=300, agreeing=170, disagreeing=130))
    reasons = facts(judge([depth("tof", 265, 35), half], (), SHAPE, 0.0, SETTINGS)[1])
    assert reasons == ("only 57% of the colours of rgb agree",)
    standing = replace(depth("tof", 299, 1), rim=RimFit(visible=20))
    assert judge([standing, half], (), SHAPE, 0.0, SETTINGS)[0] == Status.TRACKING, "the light changed"


def test_a_mesh_whose_colors_agree_while_hardly_a_distance_does_is_lost():
    colors = replace(fit(0.95), counts=VertexCounts(facing=300, agreeing=285, disagreeing=15))
    status, reasons = judge([depth("tof", 40, 160), colors], (), SHAPE, 0.0, SETTINGS)
    assert (status, facts(reasons)) == (Status.LOST, ("only 20% of the distances of tof agree",))
    assert "bring the object back into sight" in reasons[0]
    assert judge([depth("tof", 60, 140), colors], (), SHAPE, 0.0, SETTINGS)[0] == Status.DEGRADED
    both = [depth("tof", 40, 160), depth("stereo", 200, 0), colors]
    assert judge(both, (), SHAPE, 0.0, SETTINGS)[0] == Status.DEGRADED, "another sensor's distances agree"


def test_an_object_that_was_not_where_it_was_expected_is_not_said_to_be_tracked():
    surprised = depth("a", 300, 0, float("nan"), surprised=True)
    status, reasons = judge([surprised], (), SHAPE, 0.0, SETTINGS)
    assert status == Status.DEGRADED
    assert facts(reasons)[0].startswith("nothing was where the object was expected")
    assert judge([surprised, depth("b", 300, 0)], (), SHAPE, 0.0, SETTINGS) == (Status.TRACKING, ())


@pytest.mark.parametrize("name", ["deviation_m", "single_frame_deviation_m"])
def test_a_small_mesh_has_to_be_known_better(name):
    """4 mm are little of 30 cm, and much of 1 cm."""
    shape = replace(SHAPE, **{name: 0.004})
    assert judge([fit(1.0)], (), shape, 1.0, SETTINGS.for_side(0.3))[0] == Status.TRACKING
    verdict, (reason,) = judge([fit(1.0)], (), shape, 1.0, SETTINGS.for_side(0.01))
    assert verdict == Status.DEGRADED
    assert reason.startswith("nothing holds the surface along itself")
