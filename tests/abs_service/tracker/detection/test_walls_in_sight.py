"""The region above_plane without a seed where a wall is in sight, which is larger than any thing."""

import numpy as np
import pytest

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.regions import above_plane
from tests.abs_service.tracker.detection.test_regions_on_a_table import CAMERA, SMALL, assert_is, table


def test_a_wall_is_not_taken_for_the_largest_thing_on_a_table():
    distance = table(SMALL).distance
    distance[:30] = 1.0  # behind the table
    view = DepthView.of(distance, CAMERA)
    with pytest.raises(DetectionError, match="like a wall or a floor, and another one is nearer, at") as raised:
        above_plane.Settings().build().select(view)
    column, row = map(int, str(raised.value).rpartition("[")[2].partition("]")[0].split(", "))
    around = ((90, 50), (140, 50), (140, 95), (90, 95))
    for settings in (above_plane.Settings(seed=(column, row)), above_plane.Settings(polygon=around)):
        assert_is(settings.build().select(view), SMALL)


def test_a_thing_that_the_image_cuts_off_is_selected_beside_a_smaller_one():
    cut = (slice(50, 120), slice(10, 80), 0.06)
    assert np.count_nonzero(above_plane.Settings().build().select(table(cut, SMALL))[:, 80:]) == 0
