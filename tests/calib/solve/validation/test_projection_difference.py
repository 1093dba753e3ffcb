"""Two calibrations of one camera, compared as projections."""

from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.solve.validation.projection_difference import DifferenceError, chance, projection_difference

CAMERA = Camera(640, 480, 500.0, 501.0, 322.0, 238.0, Lens(np.array([-0.2, 0.03])))


def test_a_camera_does_not_differ_from_itself_wherever_it_stands():
    elsewhere = replace(CAMERA, T_rs=pose.from_rotation_vector((0.1, 0.2, 0.3), (1, 2, 3)))
    found = projection_difference(CAMERA, elsewhere, 1.0)
    assert found.differences == pytest.approx(np.zeros(found.differences.shape), abs=1e-6)
    assert found.inside.all()


def test_a_shifted_principal_point_is_nearly_a_rotation():
    shifted = replace(CAMERA, cx=CAMERA.cx + 1)
    median, largest, _ = projection_difference(CAMERA, shifted, 1.0).summary(np.ones((11, 15), np.bool_)) or (0, 0, 0)
    assert median < 0.1  # of the pixel that it is shifted by
    assert 0.05 < largest < 0.5  # the lens has moved with it


def test_a_lens_that_differs_where_no_board_was_is_found_there():
    lens = Lens(np.array([-0.2, 0.03, 0, 0, 0.2]))
    middle = np.array([[200.0, 140], [440, 140], [440, 340], [200, 340]])
    found = projection_difference(CAMERA, replace(CAMERA, lens=lens), 1.0, middle)
    inside, outside = found.summary(found.inside), found.summary(~found.inside)
    assert inside is not None
    assert outside is not None
    assert inside[1] < 0.05
    assert outside[1] > 1
    assert outside[2] in [(0, 0), (639, 0), (0, 479), (639, 479)]


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(DifferenceError, match="640 × 480 pixels, the other of 320 × 240"):
        projection_difference(CAMERA, replace(CAMERA, width=320, height=240), 1.0)
    with pytest.raises(DifferenceError, match="hardly a point"):
        projection_difference(CAMERA, CAMERA, 1.0, np.array([[10.0, 10], [12, 10], [12, 12]]))


def test_chance_is_how_far_calibrations_of_a_covariance_differ():
    names, sigmas = ("fx", "fy", "x", "k1"), np.array([2.0, 2.0, 0.1, 0.0])
    correlated = np.outer(sigmas, sigmas) * [[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    found = chance(CAMERA, names, correlated, 1.0)
    zoomed = replace(CAMERA, fx=CAMERA.fx + 1.96 * 2, fy=CAMERA.fy + 1.96 * 2)
    expected = projection_difference(CAMERA, zoomed, 1.0).differences
    assert found[0, 0] == pytest.approx(expected[0, 0], rel=0.2)
    assert chance(CAMERA, ("x",), np.ones((1, 1)), 1.0).max() < 1e-6
    assert chance(CAMERA, ("fx",), correlated[:1, :1], 1.0)[0, 0] == pytest.approx(expected[0, 0], rel=0.2)
