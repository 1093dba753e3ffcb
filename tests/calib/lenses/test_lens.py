"""Distortion agrees with OpenCV in both directions, and says where it has no inverse."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib.lenses.lens import Lens, LensError
from tests import reference

#: A webcam, an Azure Kinect's depth camera (rational, wide), and numbers without a fish-eye's extremes.
LENSES = {
    4: [-0.28, 0.07, 1e-3, -5e-4],
    5: [0.09, -0.25, -1e-3, 2e-3, 0.11],
    8: [5.2, 3.4, -1e-4, 2e-5, 0.18, 5.5, 5.1, 0.95],
}
GRID = np.stack(np.meshgrid(np.linspace(-0.6, 0.6, 13), np.linspace(-0.45, 0.45, 9)), axis=-1)

points = st.lists(st.tuples(st.floats(-0.7, 0.7), st.floats(-0.5, 0.5)), min_size=1, max_size=20).map(np.array)
coefficients = st.tuples(*[st.floats(-0.3, 0.3)] * 2, *[st.floats(-0.01, 0.01)] * 2, *[st.floats(-0.1, 0.1)] * 4)


@given(points, coefficients)
def test_distortion_is_the_formula(xy, k):
    expected = [reference.distort(x, y, np.array(k)) for x, y in xy]
    np.testing.assert_allclose(Lens(np.array(k)).distort(xy), expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("number", LENSES)
def test_distortion_is_opencv_s(number):
    lens, xy = Lens(np.array(LENSES[number])), GRID.reshape(-1, 2)
    xyz = np.column_stack([xy, np.ones(len(xy))])
    expected = cv2.projectPoints(xyz, np.zeros(3), np.zeros(3), np.eye(3), np.array(LENSES[number]))[0]
    np.testing.assert_allclose(lens.distort(GRID).reshape(-1, 2), expected[:, 0], atol=1e-12)


@given(points, coefficients)
def test_derivatives_of_the_distortion_are_its_differences(xy, k):
    lens, step = Lens(np.array(k)), 1e-6
    columns = [(lens.distort(xy + offset) - lens.distort(xy - offset)) / (2 * step) for offset in step * np.eye(2)]
    np.testing.assert_allclose(lens.jacobian(xy), np.stack(columns, axis=-1), rtol=0, atol=1e-8)


@given(points, coefficients)
def test_derivatives_by_the_coefficients_are_differences(xy, k):
    found, step = Lens(np.array(k)).coefficient_jacobian(xy), 1e-5
    columns = [
        (Lens(np.array(k) + e).distort(xy) - Lens(np.array(k) - e).distort(xy)) / (2 * step) for e in step * np.eye(8)
    ]
    np.testing.assert_allclose(found, np.stack(columns, axis=-1), rtol=0, atol=1e-8)


@pytest.mark.parametrize("number", LENSES)
def test_undistortion_is_the_inverse_and_opencv_s(number):
    lens = Lens(np.array(LENSES[number]))
    bent = lens.distort(GRID)
    np.testing.assert_allclose(lens.undistort(bent), GRID, atol=1e-9)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    arguments = (bent.reshape(-1, 1, 2), np.eye(3), np.array(LENSES[number]))
    expected = cv2.undistortPoints(*arguments, R=np.eye(3), P=np.eye(3), criteria=criteria)
    np.testing.assert_allclose(lens.undistort(bent).reshape(-1, 2), expected[:, 0], atol=1e-7)


@given(points, coefficients)
def test_undistortion_is_right_or_an_error(xy, k):
    lens = Lens(np.array(k))
    try:
        ideal = lens.undistort(xy)
    except LensError:
        return
    np.testing.assert_allclose(lens.distort(ideal), xy, atol=1e-9)


def test_points_without_inverse_spoil_no_others():
    lens, good = Lens(np.array([-0.5])), np.array([[0.1, 0.2], [-0.3, 0.1]])
    found = lens.inverse(np.array([good[0], [0.7, 0.0], good[1], [np.nan, 0.0]]))
    np.testing.assert_allclose(lens.distort(found[[0, 2]]), good, atol=1e-10)
    assert np.isnan(found[[1, 3]]).all()


def test_a_point_without_inverse_is_named():
    barrel = Lens(np.array([-0.5]))  # r (1 − r²/2) is never larger than 0.544
    assert barrel.undistort(np.array([[0.5, 0.0]])).shape == (1, 2)
    with pytest.raises(LensError, match=r"no inverse at normalised \[0\.7, 0\.0\]"):
        barrel.undistort(np.array([[0.1, 0.1], [0.7, 0.0]]))


def test_the_inverse_is_the_one_that_a_camera_sees():
    """Beyond the fold of a barrel lens there is a second solution; light from there does not reach the sensor."""
    barrel = Lens(np.array([-0.3]))
    radius = np.linspace(0, 0.65, 40)  # the fold is at r = 1.05, where the image ends at 0.70
    ideal = barrel.undistort(np.column_stack([radius, np.zeros(40)]))[:, 0]
    assert np.all(np.diff(ideal) > 0)
    assert ideal[-1] < 1.05


def test_missing_coefficients_are_zero():
    np.testing.assert_array_equal(Lens(np.array([0.1, 0.2])).coefficients, [0.1, 0.2, 0, 0, 0, 0, 0, 0])
    assert Lens().is_pinhole
    assert not Lens(np.array([0, 0, 1e-3])).is_pinhole
    np.testing.assert_array_equal(Lens().distort(GRID), GRID)


@pytest.mark.parametrize(
    "given", [np.zeros(9), np.zeros((2, 2)), np.array([np.nan]), np.array([np.inf, 0.0]), "k1", [[1.0], []]]
)
def test_what_is_no_lens_is_refused(given):
    with pytest.raises(LensError, match="at most 8 finite coefficients"):
        Lens(given)


def test_a_lens_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        Lens().coefficients[0] = 1
