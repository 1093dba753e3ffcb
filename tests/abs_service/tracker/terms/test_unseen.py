"""Status of a mesh that the depth sensors hardly see: beside their images, or turned away from them."""

from dataclasses import replace

from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.estimates.status import judge
from abs_service.tracker.terms.vertex_counts import VertexCounts
from tests.abs_service.tracker.estimates.test_status import SETTINGS, SHAPE, depth, facts, fit


def test_a_mesh_is_lost_if_no_distance_agrees_where_the_image_shows_the_rest_of_it():
    """Three quarters are outside; there was a mesh in the air, DEGRADED, before things of its colours."""
    colors = replace(fit(0.95), counts=VertexCounts(facing=400, agreeing=100, outside=300))
    out = replace(depth("tof", 0, 100), counts=VertexCounts(facing=400, disagreeing=100, outside=300))
    assert judge([out, colors], (), SHAPE, 0.0, SETTINGS)[0] == Status.LOST
    hand = replace(out, counts=VertexCounts(facing=400, disagreeing=100, behind_occluder=300))
    assert judge([hand, colors], (), SHAPE, 0.0, SETTINGS)[0] == Status.DEGRADED, "the rest may be behind a hand"


def test_a_mesh_beside_the_depth_image_is_lost_if_few_of_its_colors_agree():
    out = replace(depth("tof", 0, 0), counts=VertexCounts(facing=300, agreeing=5, missing=30, outside=265))
    few = replace(fit(0.95), counts=VertexCounts(facing=300, agreeing=80, disagreeing=20, outside=200))
    status, reasons = judge([out, few], (), SHAPE, 0.0, SETTINGS)
    assert status == Status.LOST
    assert facts(reasons)[0].startswith("88% of the vertices that should be in sight are outside the depth image")
    most = replace(fit(0.95), counts=VertexCounts(facing=300, agreeing=200, disagreeing=20, outside=80))
    assert judge([out, most], (), SHAPE, 0.0, SETTINGS)[0] == Status.DEGRADED, "a wider camera sees it"
    edge = replace(depth("tof", 0, 0), counts=VertexCounts(facing=300, agreeing=35, outside=265))
    assert judge([edge, few], (), SHAPE, 0.0, SETTINGS)[0] == Status.DEGRADED, "its edge is measured"
    back = VertexCounts(facing=12, agreeing=4, disagreeing=8, turned_away=290)
    both = [replace(depth("tof", 0, 0), counts=back), replace(few, counts=back)]
    assert judge(both, (), SHAPE, 0.0, SETTINGS)[0] == Status.LOST, "it has turned inside out"
    assert judge(both, (), SHAPE, 0.0, SETTINGS, has_back=True)[0] == Status.DEGRADED
    hidden = replace(depth("tof", 0, 0), counts=VertexCounts(facing=300, agreeing=5, behind_occluder=295))
    assert judge([hidden, few], (), SHAPE, 0.0, SETTINGS)[0] == Status.DEGRADED, "it may be behind a hand"


def test_a_mesh_that_has_turned_away_from_the_sensors_is_not_tracked():
    """It was made from an image in which all of it faced them: on what has turned away there is nothing to go by."""
    turned = replace(depth("tof", 300, 0), counts=VertexCounts(facing=140, agreeing=140, turned_away=160))
    status, reasons = judge([turned], (), SHAPE, 0.0, SETTINGS)
    assert status == Status.DEGRADED
    assert facts(reasons)[0].startswith("53% of the vertices, all of which faced the depth sensor at first, are turned")
    assert judge([turned, depth("b", 300, 0)], (), SHAPE, 0.0, SETTINGS) == (Status.TRACKING, ())
    assert judge([turned], (), SHAPE, 0.0, SETTINGS, has_back=True) == (Status.TRACKING, ())
    less = replace(turned, counts=VertexCounts(facing=160, agreeing=160, turned_away=140))
    assert judge([less], (), SHAPE, 0.0, SETTINGS) == (Status.TRACKING, ())
