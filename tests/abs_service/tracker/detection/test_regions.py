"""The regions nearest, box and mask select the pixels of the object."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from abs_service.tracker.detection.depth_view import DepthView, at_points
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.regions import box, mask, nearest
from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens

SHAPE = (48, 64)
CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


def scene(*parts: tuple[slice, slice, float], background: float = 2.0) -> np.ndarray:
    distance = np.full(SHAPE, background, np.float32)
    for rows, columns, z in parts:
        distance[rows, columns] = z
    return distance


def selected(region, distance):
    return region.build().select(DepthView.of(distance, CAMERA))


def selected_of(region, points):
    """The pixels that a region selects of points in the rig."""
    view = DepthView.of(np.ones(SHAPE, np.float32), CAMERA)
    return region.build().select(replace(view, points_r=points))


NEAR = (slice(10, 30), slice(5, 25), 1.0)
MIDDLE = (slice(10, 40), slice(35, 60), 1.3)


def test_the_nearest_surface_is_selected_but_for_its_rim():
    inside = selected(nearest.Settings(), scene(NEAR, MIDDLE))
    assert inside[12:28, 7:23].all()
    inside[10:30, 5:25] = False
    assert not inside.any()


def test_noise_neither_cuts_nor_connects():
    generator = np.random.default_rng(1)
    distance = scene(NEAR, MIDDLE) + generator.normal(0, 5e-3, SHAPE).astype(np.float32)
    distance[generator.uniform(size=SHAPE) < 0.03] = np.nan  # holes
    distance[generator.uniform(size=SHAPE) < 0.02] = 1.5  # flying pixels
    inside = selected(nearest.Settings(), distance)
    assert np.count_nonzero(inside[12:28, 7:23]) > 0.7 * 16 * 16
    inside[10:30, 5:25] = False
    assert not inside.any()


def test_a_polygon_leaves_out_what_is_nearer_beside_it():
    inside = selected(nearest.Settings(polygon=((29, 4), (63, 4), (63, 46), (29, 46))), scene(NEAR, MIDDLE))
    assert inside[12:38, 37:58].all()
    inside[10:40, 35:60] = False
    assert not inside.any()


def test_a_lasso_cuts_the_object_from_what_it_touches():
    triangle = ((10, 5), (50, 5), (10, 45))
    inside = selected(nearest.Settings(minimum_pixels=16, polygon=triangle), scene())
    rows, columns = np.nonzero(inside)
    assert (columns + rows <= 55).all()
    assert inside[8:30, 12:20].all()


def test_small_surfaces_are_noise():
    speck = (slice(36, 44), slice(2, 10), 0.5)
    inside = selected(nearest.Settings(minimum_pixels=100), scene(NEAR, speck))
    assert inside[20, 15]
    assert not inside[40, 6]
    assert selected(nearest.Settings(minimum_pixels=16), scene(NEAR, speck))[40, 6]


def test_the_largest_step_decides_what_is_connected():
    stair = scene((slice(10, 30), slice(5, 25), 1.0), (slice(10, 30), slice(25, 45), 1.03))
    assert selected(nearest.Settings(maximum_step_m=0.04), stair)[20, 40]
    assert not selected(nearest.Settings(maximum_step_m=0.02), stair)[20, 40]


@pytest.mark.parametrize("rows", [slice(0, 48), slice(20, 48), slice(3, 45)])
def test_a_surface_that_spans_most_of_the_image_is_the_scene(rows):
    table = scene((rows, slice(0, 60), 1.0))  # no returns in the last columns
    table[:, 60:] = np.nan
    with pytest.raises(DetectionError, match=r'the scene, not an object .* region.type to "above_plane" .* "seed"'):
        selected(nearest.Settings(), table)


@pytest.mark.parametrize(
    "part",
    [
        (slice(4, 44), slice(7, 58), 1.0),  # a sheet that fills two thirds of the image
        (slice(17, 31), slice(0, 64), 1.0),  # a band across the image
    ],
)
@pytest.mark.parametrize("background", [2.0, np.nan])
def test_a_large_object_is_no_scene(part, background):
    assert selected(nearest.Settings(), scene(part, background=background))[25, 30]


@pytest.mark.parametrize(("ahead_m", "is_object"), [(0.0, False), (0.01, False), (0.3, True)])
def test_a_piece_torn_off_the_scene_is_the_scene(ahead_m, is_object):
    distance = scene((slice(0, 48), slice(0, 64), 1.0))
    distance += np.linspace(0, 0.1, 64, dtype=np.float32)  # the piece at its left end is nearest
    distance[8:40, 0:16] = np.nan
    distance[12:36, 3:14] = 1.0 - ahead_m
    region = nearest.Settings()
    if is_object:
        assert selected(region, distance)[16:32, 6:11].all()
    else:
        with pytest.raises(DetectionError, match="it is the scene"):
            selected(region, distance)


def test_an_empty_image_has_no_surface():
    with pytest.raises(DetectionError, match="minimum_pixels = 200"):
        selected(nearest.Settings(), np.full(SHAPE, np.nan, np.float32))


def grid_points() -> np.ndarray:
    columns, rows = np.meshgrid(np.arange(64) / 64, np.arange(48) / 48)
    return np.stack([columns, rows, np.ones(SHAPE)], axis=-1)


def test_a_box_selects_the_points_in_it():
    points = grid_points()
    points[20, 20] = np.nan
    inside = selected_of(box.Settings((0.25, 0.25, 0.9), (0.5, 0.75, 1.1)), points)
    expected = np.zeros(SHAPE, bool)
    expected[12:37, 16:33] = True
    expected[20, 20] = False
    np.testing.assert_array_equal(inside, expected)


def test_an_empty_box_is_an_error():
    region = box.Settings((0.25, 0.25, 2.0), (0.5, 0.75, 3.0))
    with pytest.raises(DetectionError, match=r"\[0.25, 0.25, 2.0\] … \[0.5, 0.75, 3.0\] holds no surface"):
        selected_of(region, grid_points())


def test_a_box_is_turned_about_its_centre():
    points = grid_points()
    center, turn = np.array([0.5, 0.5, 1.0]), [0.1, -0.2, 0.6]
    inside = selected_of(box.Settings((0.3, 0.4, 0.8), (0.7, 0.6, 1.2), rotation=(0.1, -0.2, 0.6)), points)
    across = (points - center) @ pose.from_rotation_vector(turn, [0, 0, 0])[:3, :3]
    np.testing.assert_array_equal(inside, np.all(np.abs(across) <= (0.2, 0.1, 0.2), axis=-1))
    assert inside[24, 32]
    assert inside[24 + 5, 32 + 9]  # along the turned long side
    assert not inside[24 - 5, 32 + 9]


def test_an_empty_turned_box_says_how_it_is_turned():
    region = box.Settings((0.25, 0.25, 2.0), (0.5, 0.75, 3.0), rotation=(0.0, 0.0, 0.5))
    with pytest.raises(DetectionError, match=r"turned by \[0.0, 0.0, 0.5\] rad holds no surface"):
        selected_of(region, grid_points())


@pytest.mark.parametrize("highest", [(0.0, 1.0, 1.0), (1.0, -1.0, 1.0)])
def test_a_box_inside_out_is_an_error(highest):
    with pytest.raises(DetectionError, match=r"lowest = \[0.0, 0.0, 0.0\] must be below highest"):
        box.Settings((0.0, 0.0, 0.0), highest)


def drawn(folder, channels: int):
    """A mask image, and the object's pixels in it."""
    inside = np.zeros(SHAPE, bool)
    inside[5:25, 10:40] = True
    image = (inside * np.uint8(255))[..., None].repeat(channels, axis=2).squeeze()
    if channels == 4:
        image[..., :3] = 77  # with an alpha channel the brightness is ignored
    if channels == 3:
        image[..., :2] = 0
    path = folder / "mask.png"
    cv2.imwrite(str(path), image)
    return path, inside


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_a_mask_selects_what_was_drawn_and_returned(tmp_path, channels):
    path, expected = drawn(tmp_path, channels)
    distance = np.ones(SHAPE, np.float32)
    distance[10, 15] = np.nan
    expected[10, 15] = False
    np.testing.assert_array_equal(selected(mask.Settings(path), distance), expected)


def test_a_mask_of_another_size_is_an_error(tmp_path):
    path, _ = drawn(tmp_path, 1)
    with pytest.raises(DetectionError, match=r"mask is \(64, 48\) pixels, the depth image \(32, 24\)"):
        mask.Settings(path).build().select(DepthView.of(np.ones((24, 32), np.float32), Camera(32, 24, 30, 30, 16, 12)))


def test_a_mask_over_nothing_is_an_error(tmp_path):
    path, _ = drawn(tmp_path, 1)
    with pytest.raises(DetectionError, match="holds no surface"):
        selected(mask.Settings(path), np.full(SHAPE, np.nan, np.float32))


@pytest.mark.parametrize("content", [None, b"no image"])
def test_a_mask_that_cannot_be_read_is_named(tmp_path, content):
    path = tmp_path / "mask.png"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DetectionError, match=r"file = .*mask\.png': cannot be read"):
        mask.Settings(path).build()


def test_a_point_beside_the_field_of_view_has_no_value_where_the_lens_folds_it_into_the_image():
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5, Lens(np.array([-0.25, 0.0, 0.0, 0.0, 0.0])))
    values = at_points(np.full(SHAPE, 2.0), camera, np.array([[0.1, 0.1, 1.0], [1.9, 0.0, 1.0]]))
    assert values[0] == 2.0
    assert np.isnan(values[1])
