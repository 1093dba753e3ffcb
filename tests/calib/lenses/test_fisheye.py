"""A fisheye agrees with OpenCV in both directions, and has no inverse at 90° or beyond its fold."""

import dataclasses

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.camera import Camera
from calib.lenses.by_name import lens_of
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens, LensError
from tests import reference

#: An equidistant lens, a wide one, and one whose image folds back before 90°.
LENSES = {"equidistant": [], "wide": [0.05, -0.01, 3e-3, -1e-3], "folding": [-0.15, -0.02]}

angles = st.lists(st.tuples(st.floats(0, 1.5), st.floats(-np.pi, np.pi)), min_size=1, max_size=20).map(np.array)
coefficients = st.tuples(*[st.floats(-limit, limit) for limit in (0.1, 0.05, 0.02, 0.01)])


def ideal_of(theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
    return np.tan(theta)[..., None] * np.stack([np.cos(phi), np.sin(phi)], axis=-1)


@given(angles, coefficients)
def test_distortion_is_the_formula(places, k):
    xy = ideal_of(*places.T)
    expected = [reference.distort_fisheye(x, y, np.array(k)) for x, y in xy]
    np.testing.assert_allclose(KannalaBrandt(np.array(k)).distort(xy), expected, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize("name", LENSES)
def test_distortion_is_opencv_s(name):
    lens = lens_of("fisheye", LENSES[name])
    xy = ideal_of(np.linspace(0, 1.5, 200), np.linspace(0, 20, 200))
    xyz = np.column_stack([xy, np.ones(len(xy))])[None]
    expected = cv2.fisheye.projectPoints(xyz, np.zeros(3), np.zeros(3), np.eye(3), lens.coefficients)[0]
    np.testing.assert_allclose(lens.distort(xy), expected[0], atol=1e-12)


@given(angles, coefficients)
def test_derivatives_are_differences(places, k):
    lens, xy, step = KannalaBrandt(np.array(k)), ideal_of(*places.T), 1e-6
    columns = [(lens.distort(xy + offset) - lens.distort(xy - offset)) / (2 * step) for offset in step * np.eye(2)]
    np.testing.assert_allclose(lens.jacobian(xy), np.stack(columns, axis=-1), rtol=0, atol=1e-8)
    others = [
        (KannalaBrandt(lens.coefficients + e).distort(xy) - KannalaBrandt(lens.coefficients - e).distort(xy)) / 2e-3
        for e in 1e-3 * np.eye(4)
    ]
    np.testing.assert_allclose(lens.coefficient_jacobian(xy), np.stack(others, axis=-1), rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", ["equidistant", "wide"])
def test_undistortion_is_the_inverse_and_opencv_s(name):
    lens = lens_of("fisheye", LENSES[name])
    xy = ideal_of(np.linspace(0, 1.5, 60)[:, None], np.linspace(0, 6, 10))
    bent = lens.distort(xy)
    np.testing.assert_allclose(lens.undistort(bent), xy, rtol=1e-9, atol=1e-12)
    within = np.linalg.norm(bent, axis=-1) < 1.5  # from π/2 on, OpenCV takes a distorted radius for π/2
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    found = cv2.fisheye.undistortPoints(bent[within][:, None], np.eye(3), lens.coefficients, criteria=criteria)
    np.testing.assert_allclose(lens.undistort(bent[within]), found[:, 0], rtol=1e-7, atol=1e-9)


@settings(max_examples=40)
@given(angles, coefficients)
def test_the_inverse_is_right_and_before_the_fold_or_there_is_none(places, k):
    lens = KannalaBrandt(np.array(k))
    xy = places[:, :1] * np.stack([np.cos(places[:, 1]), np.sin(places[:, 1])], axis=-1)
    ideal = lens.inverse(xy)
    found = np.isfinite(ideal).all(axis=1)
    np.testing.assert_allclose(lens.distort(ideal[found]), xy[found], atol=1e-9)
    # Up to the angle that was found the distorted radius only grows; where none was found, it never gets so far.
    theta = np.arctan(np.linalg.norm(ideal, axis=1))
    for angle in theta[found]:
        steps = ideal_of(np.linspace(0, angle, 50), np.zeros(50))
        assert np.all(np.diff(lens.distort(steps)[:, 0]) > -1e-12)
    growing = lens.distort(ideal_of(np.linspace(0, np.pi / 2 - 1e-6, 2000), np.zeros(2000)))[:, 0]
    fold = growing[: np.argmax(np.append(np.diff(growing) < 0, True)) + 1].max()
    assert np.all(np.linalg.norm(xy[~found], axis=1) > fold - 1e-5)


def test_what_lies_at_90_degrees_has_no_inverse():
    lens = KannalaBrandt()
    assert lens.undistort(np.array([1.57, 0.0]))[0] > 1000
    with pytest.raises(LensError, match=r"no inverse at normalised \[1\.58, 0\.0\]"):
        lens.undistort(np.array([[0.1, 0.1], [1.58, 0.0]]))
    assert np.isnan(lens.inverse(np.array([[0.1, np.nan], [np.inf, 0.0]]))).all()


def test_a_camera_with_a_fisheye_projects_and_looks_back():
    lens = KannalaBrandt(np.array(LENSES["wide"]))
    camera = Camera(128, 96, 58.0, 58.5, 63.2, 47.9, lens)
    columns, rows = np.meshgrid(np.arange(128), np.arange(96))
    np.testing.assert_allclose(camera.project(camera.rays()), np.stack([columns, rows], axis=-1), atol=1e-9)
    assert np.degrees(np.arccos(camera.rays()[..., 2])).max() > 70
    point, step = np.array([1.0, -0.7, 0.4]), 1e-6
    jacobian = [(camera.project(point + e) - camera.project(point - e)) / (2 * step) for e in step * np.eye(3)]
    np.testing.assert_allclose(camera.projection_jacobian(point), np.stack(jacobian, axis=-1), atol=1e-6)


def test_the_kind_of_lens_is_part_of_the_calib_id_and_did_not_change_that_of_old_cameras():
    camera = Camera(32, 24, 40.0, 42.0, 15.2, 11.9)
    assert camera.calib_id == "275fe685cda017dc"
    numbers = np.array([0.1, 0.0, 0.0, 0.0])
    ids = {dataclasses.replace(camera, lens=lens).calib_id for lens in (Lens(numbers), KannalaBrandt(numbers))}
    assert len(ids) == 2


@pytest.mark.parametrize(
    ("name", "numbers", "message"),
    [
        ("fisheye", [0.0] * 5, "at most 4 finite coefficients"),
        ("brown_conrady", [np.nan], "at most 8 finite coefficients"),
        ("fish", [], r'lens_model = "fish" is none of \[\'brown_conrady\', \'fisheye\'\]'),
    ],
)
def test_what_is_no_lens_is_refused(name, numbers, message):
    with pytest.raises(LensError, match=message):
        lens_of(name, numbers)
