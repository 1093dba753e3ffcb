"""Undistorted images, and images warped into another camera, compared with closed-form geometry."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.tracker.models.base import ModelError
from abs_service.tracker.synthesis import undistorted, warped
from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.images.color import GaussianColor
from calib.rig import Rig, Sensor
from calib.warp.pinhole import MAX_GROWTH, pinhole_of, resampling
from tests.abs_service.tracker.scenes import CAMERA, depth_image, observation, plane_distance, sheet

NORMAL = np.array([-0.2, 0.1, 1.0])
WIDE = Camera(96, 72, 60.0, 61.0, 48.2, 35.1, Lens(np.array([-0.2, 0.05])))
lenses = st.tuples(*(st.floats(-limit, limit) for limit in (0.15, 0.05, 2e-3, 2e-3)))


def indices(camera: Camera, table: np.ndarray) -> np.ndarray:
    """Pixels (…, 2) = (column, row) of indices into a bordered image."""
    return np.stack([table % (camera.width + 2) - 1, table // (camera.width + 2) - 1], axis=-1)


@settings(max_examples=25)
@given(lenses)
def test_every_pixel_without_distortion_shows_the_nearest_line_of_sight(coefficients):
    camera = dataclasses.replace(CAMERA, lens=Lens(np.array(coefficients)))
    pinhole = pinhole_of(camera)
    table = resampling(pinhole, camera)
    assert not np.any([table[0], table[-1]])
    assert not np.any([table[:, 0], table[:, -1]])
    row, column = np.nonzero(table)
    points = pose.transform(pinhole.T_rs, pinhole.directions(np.stack([column - 1, row - 1], axis=-1)))
    error = camera.project(points) - indices(camera, table[row, column])
    assert np.abs(error).max() < 0.5 + 1e-6
    # The field of view is complete: all corners of the image are mapped.
    corners = camera.directions(np.array([[0, 0], [camera.width - 1, camera.height - 1]]))
    place = pinhole.project(pose.transform(pinhole.T_rs, corners))
    assert np.all(place > -0.5)
    assert np.all(place < np.array([pinhole.width, pinhole.height]) - 0.5)


def test_without_distortion_nothing_is_resampled():
    camera = dataclasses.replace(CAMERA, lens=Lens())
    assert pinhole_of(camera).calib_id == camera.calib_id
    table = resampling(camera, camera)
    assert np.array_equal(table[1:-1, 1:-1], np.arange(50 * 66).reshape(50, 66)[1:-1, 1:-1])


def test_a_wide_lens_loses_its_rim_rather_than_growing_without_bounds():
    fish = Camera(96, 72, 25.0, 25.0, 47.5, 35.5, Lens(np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.6])))
    pinhole = pinhole_of(fish)
    assert pinhole.width <= MAX_GROWTH * 96 + 2
    assert np.count_nonzero(resampling(pinhole, fish)) > 0.5 * 96 * 72


def test_undistorted_measurements_are_those_of_the_nearest_pixels():
    rig = Rig("r", {"tof": Sensor("tof", WIDE, GaussianPolynomial(((0.01,),)))})
    synthesis = undistorted.Settings().build(rig, sheet())
    camera = synthesis.view("tof", np.zeros((117, 0), np.float32)).camera
    assert camera.lens.is_pinhole
    texture = np.zeros((74, 98, 8), np.float32)
    texture[1:-1, 1:-1, 0] = plane_distance(WIDE, NORMAL, 1.0)
    texture[1:-1, 1:-1, 3] = 1
    there = synthesis.texture("tof", texture)
    known = there[..., 3] > 0
    expected = np.pad(plane_distance(camera, NORMAL, 1.0), 1)
    assert np.count_nonzero(known) > 0.9 * 96 * 72
    # The nearest pixel is at most half a pixel of the original away; the lens enlarges it towards the rim.
    steps = [np.abs(np.diff(expected[1:-1, 1:-1], axis=axis)).max() / 2 for axis in (0, 1)]
    assert np.abs(there[known, 0] - expected[known]).max() < 1.5 * sum(steps)
    colors = np.moveaxis(np.indices((72, 96, 1))[:, :, :, 0], 0, -1).astype(np.float32)
    image = synthesis.image("tof", colors)
    assert np.array_equal(np.isfinite(image[..., 0]), known[1:-1, 1:-1])


def warped_rig() -> Rig:
    color = Camera(160, 120, 300.0, 300.0, 79.5, 59.5, Lens(np.array([-0.1])), pose.look_at([0.12, 0, 0], [0, 0, 1.0]))
    sensors = [Sensor("tof", CAMERA, GaussianPolynomial(((0.01,),))), Sensor("color", color, GaussianColor())]
    return Rig("r", {sensor.name: sensor for sensor in sensors})


def position_colors(camera: Camera, distance: np.ndarray) -> np.ndarray:
    """An image with the coordinates of the visible points as colours, in cm."""
    return (camera.unproject(distance) * 100).astype(np.float32)


def test_colours_are_those_of_the_points_that_the_depth_sensor_sees():
    rig = warped_rig()
    color, synthesis = rig.sensors["color"].camera, warped.Settings().build(rig, sheet())
    seen = synthesis.observe(observation(tof=depth_image(plane_distance(CAMERA, NORMAL, 1.0))))
    image = seen.image("color", position_colors(color, plane_distance(color, NORMAL, 1.0)))
    view = synthesis.view("color", np.zeros((117, 3), np.float32))
    expected = position_colors(view.camera, plane_distance(view.camera, NORMAL, 1.0))
    known = np.isfinite(image[..., 0])
    assert np.mean(known) > 0.8
    assert np.linalg.norm((image - expected)[known], axis=-1).max() < 0.4  # a pixel of the camera is 3.3 mm wide


def test_colours_of_what_is_hidden_from_the_other_camera_are_unknown():
    rig = warped_rig()
    color, synthesis = rig.sensors["color"].camera, warped.Settings().build(rig, sheet())

    def with_board(camera: Camera) -> np.ndarray:
        """A wall at 1.3 m, and in front of it a board at 0.8 m that is 8 cm wide."""
        wall, board = (plane_distance(camera, np.array([0, 0, 1.0]), z) for z in (1.3, 0.8))
        on_board = np.all(np.abs(camera.unproject(board)[..., :2]) < 0.04, axis=-1)
        return np.where(on_board, board, wall)

    seen = synthesis.observe(observation(tof=depth_image(with_board(CAMERA))))
    image = seen.image("color", position_colors(color, with_board(color)))
    camera = synthesis.view("color", np.zeros((117, 3), np.float32)).camera
    expected = position_colors(camera, with_board(camera))
    known = np.isfinite(image[..., 0])
    # A wall's colour on the board, or the other way round, would be an error of half a metre of depth: 50.
    error = np.abs(image - expected)[known, 2]
    assert np.mean(error > 25) < 0.01
    assert 0.02 < np.mean(~known) < 0.4


def test_without_distances_no_colour_is_known():
    seen = warped.Settings().build(warped_rig(), sheet()).observe(observation())
    assert np.isnan(seen.image("color", np.full((120, 160, 3), 9.0, np.float32))).all()


@pytest.mark.parametrize("sensor", ["color", "thermal"])
def test_everything_is_warped_into_a_depth_sensor(sensor):
    with pytest.raises(ModelError, match=rf'synthesis.sensor = "{sensor}" must be a depth sensor .* \[\'tof\'\]'):
        warped.Settings(sensor).build(warped_rig(), sheet())
