"""Projection (eq. 10), its inverse, the pixel-centre convention, and what is no camera."""

import dataclasses

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib import pose
from calib.camera import Camera, CameraError
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens
from tests import reference

LENS = Lens(np.array([-0.2, 0.05, 1e-3, -2e-3, 0.01]))
CAMERA = Camera(32, 24, 40.0, 42.0, 15.2, 11.9, LENS, pose.from_rotation_vector([0.2, -0.1, 0.3], [0.1, 0.2, -0.05]))

rig_points = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(0.8, 3.0)).map(np.array)


@given(rig_points)
def test_projection_is_the_equation(point):
    np.testing.assert_allclose(CAMERA.project(point), reference.project(CAMERA, point), rtol=1e-12)
    assert CAMERA.distance(point) == pytest.approx(reference.distance(CAMERA, point), rel=1e-14)


@given(rig_points)
def test_projection_is_opencv_s(point):
    rotation_vector, translation = pose.to_rotation_vector(CAMERA.T_sr)
    K = np.array([[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]])
    expected = cv2.projectPoints(point[None], rotation_vector, translation, K, LENS.coefficients)[0]
    np.testing.assert_allclose(CAMERA.project(point), expected[0, 0], atol=1e-9)


@given(rig_points)
def test_derivatives_of_the_projection_are_its_differences(point):
    step = 1e-6
    columns = [
        (CAMERA.project(point + offset) - CAMERA.project(point - offset)) / (2 * step) for offset in step * np.eye(3)
    ]
    np.testing.assert_allclose(CAMERA.projection_jacobian(point), np.stack(columns, axis=-1), rtol=0, atol=1e-6)
    np.testing.assert_array_equal(CAMERA.projection_jacobian(point[None])[0], CAMERA.projection_jacobian(point))


def test_unprojection_is_the_inverse():
    distance = np.random.default_rng(1).uniform(0.5, 3, (24, 32))
    points = CAMERA.unproject(distance)
    columns, rows = np.meshgrid(np.arange(32), np.arange(24))
    np.testing.assert_allclose(CAMERA.project(points), np.stack([columns, rows], axis=-1), atol=1e-7)
    np.testing.assert_allclose(CAMERA.distance(points), distance, rtol=1e-12)


def test_the_field_of_view_ends_before_the_lens_folds_points_into_the_image():
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5, Lens(np.array([-0.25, 0.0, 0.0, 0.0, 0.0])))
    points = np.array([[0.0, 0.0, 1.0], [1.9, 0.0, 1.0], [0.1, 0.1, -1.0], [0.0, 0.0, 0.0]])
    assert 0 < camera.project(points)[1, 0] < 63
    assert camera.in_field(points).tolist() == [True, False, False, False]
    assert camera.in_field(camera.unproject(np.ones((48, 64)))).all()


def test_no_return_stays_no_return():
    distance = np.ones((24, 32))
    distance[3, 4] = np.nan
    assert np.argwhere(np.isnan(CAMERA.unproject(distance)).any(axis=2)).tolist() == [[3, 4]]


def test_rays_are_of_unit_length_and_forward():
    rays = CAMERA.rays()
    assert rays.shape == (24, 32, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=2), 1, rtol=1e-14)
    assert np.all(rays[..., 2] > 0)
    np.testing.assert_allclose(CAMERA.directions(np.array([[4.0, 3.0]]))[0], rays[3, 4], atol=1e-9)


@pytest.mark.parametrize("z", [0.0, -1e-9, -2.0])
def test_what_is_not_before_the_camera_has_no_pixel(z):
    camera = Camera(32, 24, 40.0, 40.0, 15.5, 11.5)
    assert np.isnan(camera.project(np.array([0.1, 0.1, z]))).all()
    assert np.isnan(camera.project(np.array([0.0, 0.0, z]))).all()


def test_pixel_centres_are_at_integers():
    camera = Camera(4, 2, 1.0, 1.0, 1.5, 0.5)  # the optical axis meets the corner of four pixels
    corner = np.array([-2.0, -1.0, 1.0])  # (−0.5, −0.5): where the image begins
    np.testing.assert_array_equal(camera.project(corner), [-0.5, -0.5])
    np.testing.assert_array_equal(camera.project(corner + np.array([0.5, 0.5, 0])), [0, 0])
    assert reference.seen_pixel(camera, corner + np.array([1e-9, 1e-9, 0]), np.array([0, 0, -1])) == (0, 0)
    assert reference.seen_pixel(camera, corner - np.array([1e-9, 0, 0]), np.array([0, 0, -1])) is None


def moved(camera: Camera) -> np.ndarray:
    return camera.T_rs @ pose.from_rotation_vector([0, 0, 0], [1e-6, 0, 0])


@pytest.mark.parametrize(
    "change",
    [
        {"width": 33},
        {"height": 25},
        *({name: getattr(CAMERA, name) + 1e-9} for name in ("fx", "fy", "cx", "cy")),
        *({"lens": Lens(LENS.coefficients + 1e-9 * np.eye(8)[i])} for i in range(8)),
        {"T_rs": moved(CAMERA)},
    ],
    ids=lambda change: next(iter(change)),
)
def test_every_number_changes_the_calib_id(change):
    assert dataclasses.replace(CAMERA, **change).calib_id != CAMERA.calib_id


def test_equal_cameras_have_equal_calib_ids():
    again = Camera(32, 24, 40.0, 42.0, 15.2, 11.9, Lens(LENS.coefficients.copy()), CAMERA.T_rs.copy())
    assert again.calib_id == CAMERA.calib_id
    assert len(CAMERA.calib_id) == 16


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, r"width = 0: must be a whole number of pixels"),
        ({"height": -1}, r"height = -1: must be"),
        ({"fx": 0.0}, r"fx = 0\.0: must be positive and finite"),
        ({"fy": -3.0}, r"fy = -3\.0: must be positive"),
        ({"cx": np.nan}, "cx = nan: must be finite"),
        ({"fx": np.inf}, "fx = inf: must be positive and finite"),
        ({"T_rs": 2 * np.eye(4)}, r"T_rs = \[\[2\., 0\., .*: must be a rigid"),
        ({"T_rs": np.diag([1.0, 1.0, -1.0, 1.0])}, r"T_rs = \[\[ 1\., .*: must be a rigid"),
        ({"T_rs": np.eye(3)}, r"T_rs = \[\[1\., 0\., 0\.\],\n.*: must be a rigid 4 × 4 pose"),
        ({"width": "32"}, r"width = '32': must be a whole number of pixels, 1 to 65535"),
        ({"height": 10**9}, r"height = 1000000000: must be a whole number of pixels, 1 to 65535"),
        ({"width": 32.5}, r"width = 32\.5: must be a whole number"),
        ({"fx": "40"}, r"fx = '40': must be positive and finite"),
        ({"cy": None}, r"cy = None: must be finite"),
        ({"T_rs": None}, r"T_rs = None: must be a rigid"),
        ({"T_rs": [[1.0], [1.0, 2.0]]}, r"T_rs = \[\[1\.0\], \[1\.0, 2\.0\]\]: must be a rigid"),
        ({"lens": [0.1]}, r"lens = \[0\.1\]: must be a lens model"),
    ],
)
def test_numbers_that_describe_no_camera_are_named(change, message):
    with pytest.raises(CameraError, match=f"(?s)^{message}"):
        dataclasses.replace(CAMERA, **change)


@pytest.mark.parametrize(
    ("call", "given", "message"),
    [
        (CAMERA.project, np.zeros((5, 2)), r"points_r has shape \(5, 2\): must be \(…, 3\)"),
        (CAMERA.project, "x", r"points_r = 'x': must be an array \(…, 3\)"),
        (CAMERA.distance, 1.0, r"points_r has shape \(\): must be \(…, 3\)"),
        (CAMERA.unproject, np.zeros((3, 3)), r"distance has shape \(3, 3\): must be \(\d+, \d+\), \(height, width\)"),
    ],
)
def test_points_and_images_that_do_not_fit_are_named(call, given, message):
    with pytest.raises(CameraError, match=f"^{message}"):
        call(given)


def test_a_pose_may_be_nested_lists():
    camera = dataclasses.replace(CAMERA, T_rs=CAMERA.T_rs.tolist())
    assert camera.calib_id == CAMERA.calib_id


@pytest.mark.parametrize("lens", [Lens(np.array([0.1, -0.2])), KannalaBrandt(np.array([0.1]))])
def test_cameras_of_the_same_parameters_are_equal(lens):
    camera, same = (Camera(640, 480, 500.0, 500.0, 320.0, 240.0, type(lens)(lens.coefficients)) for _ in range(2))
    assert camera == same
    assert hash(camera) == hash(same)
    assert {camera.lens: 1}[lens] == 1
    assert camera != dataclasses.replace(camera, fx=501.0)
    assert camera != dataclasses.replace(camera, lens=type(lens)())
    assert Lens() != KannalaBrandt()


def test_a_camera_keeps_a_pose_of_its_own():
    given = np.eye(4)
    camera = Camera(640, 480, 500.0, 500.0, 320.0, 240.0, T_rs=given)
    given[0, 3] = 1.0
    assert camera.center[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        camera.T_rs[0, 3] = 1.0
