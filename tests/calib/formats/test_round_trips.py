"""Formats of other programs: what is written is read again, exactly."""

from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from calib import pose
from calib.camera import Camera
from calib.formats import colmap, depthai, kalibr, mrcal, opencv, ros, tf, urdf
from calib.formats.content import Hints
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens

HINTS = Hints("tof")
numbers = st.floats(-2, 2, allow_subnormal=False)
places = st.tuples(st.tuples(numbers, numbers, numbers), st.tuples(numbers, numbers, numbers))


def lenses(count: int, *, fisheyes: bool = True):
    brown = st.lists(numbers, min_size=count, max_size=count).map(lambda given: Lens(np.array(given)))
    fisheye = st.lists(numbers, max_size=4).map(lambda given: KannalaBrandt(np.array(given)))
    return brown | fisheye if fisheyes else brown


def cameras(count: int, *, fisheyes: bool = True):
    return st.builds(
        lambda size, matrix, lens, place: Camera(*size, *matrix, lens=lens, T_rs=pose.from_rotation_vector(*place)),
        st.tuples(st.integers(1, 8192), st.integers(1, 8192)),
        st.tuples(*[st.floats(0.1, 1e4)] * 4),
        lenses(count, fisheyes=fisheyes),
        places,
    )


def assert_same(found: Mapping[str, Camera], expected: Mapping[str, Camera], poses: str = "absolute") -> None:
    """Equal to 1e-9; poses as they are, relative to the first, or not at all."""
    assert list(found) == list(expected)
    origin = next(iter(expected.values())).T_sr if poses == "relative" else np.eye(4)
    for name, camera in expected.items():
        one = found[name]
        assert (one.width, one.height, one.lens.name) == (camera.width, camera.height, camera.lens.name)
        for key in ("fx", "fy", "cx", "cy"):
            assert getattr(one, key) == pytest.approx(getattr(camera, key), rel=1e-9)
        np.testing.assert_allclose(one.lens.coefficients, camera.lens.coefficients, rtol=1e-9, atol=1e-12)
        T_rs = np.eye(4) if poses == "none" else origin @ camera.T_rs
        np.testing.assert_allclose(one.T_rs, T_rs, rtol=0, atol=1e-9)


@settings(max_examples=40)
@given(cameras(4), cameras(4), cameras(2))
def test_kalibr_keeps_all_but_where_the_first_camera_is(first: Camera, second: Camera, third: Camera) -> None:
    given = {"tof": first, "left": second, "right": third}
    written = kalibr.write(given)
    assert_same(kalibr.read(written.text, HINTS).cameras, given, "relative")
    assert bool(written.lost) == (not np.array_equal(first.T_rs, np.eye(4)))


@settings(max_examples=40)
@given(cameras(8))
def test_ros_keeps_all_but_the_pose(camera: Camera) -> None:
    written = ros.write({"tof": camera})
    assert_same(ros.read(written.text, HINTS).cameras, {"tof": camera}, "none")
    assert written.lost == (() if np.array_equal(camera.T_rs, np.eye(4)) else ("the pose of tof",))


@pytest.mark.parametrize(
    "dialect", [cv2.FILE_STORAGE_FORMAT_YAML, cv2.FILE_STORAGE_FORMAT_XML, cv2.FILE_STORAGE_FORMAT_JSON]
)
@settings(max_examples=15)
@given(given=st.lists(cameras(8), min_size=1, max_size=3))
def test_opencv_keeps_all(dialect: int, given: list[Camera]) -> None:
    named: dict[str, Camera] = dict(zip(("tof", "left", "right"), given))
    written = opencv.write(named, dialect)
    assert_same(opencv.read(written.text, Hints("other")).cameras, named)
    assert written.lost == ()


@settings(max_examples=40)
@given(cameras(8), cameras(5))
def test_depthai_keeps_all_but_names_and_where_the_first_camera_is(first: Camera, second: Camera) -> None:
    written = depthai.write({"tof": first, "left": second})
    assert_same(depthai.read(written.text, HINTS).cameras, {"cam_a": first, "cam_b": second}, "relative")
    assert "tof is cam_a, left is cam_b" in written.lost[-1]


@settings(max_examples=40)
@given(cameras(8), cameras(4))
def test_colmap_keeps_all_but_names_and_poses(first: Camera, second: Camera) -> None:
    written = colmap.write({"tof": first, "left": second})
    assert_same(colmap.read(written.text, HINTS).cameras, {"camera1": first, "camera2": second}, "none")
    assert written.lost[0] == "names: tof is 1, left is 2"
    assert list(colmap.read(colmap.write({"left": first}).text, HINTS).cameras) == ["tof"]


@settings(max_examples=40)
@given(cameras(8, fisheyes=False))
def test_mrcal_keeps_all(camera: Camera) -> None:
    assert_same(mrcal.read(mrcal.write({"tof": camera}).text, HINTS).cameras, {"tof": camera})


def _origin(joint: Any) -> np.ndarray:
    """Pose of a URDF origin: fixed axes, roll about x first."""
    origin = joint.find("origin")
    xyz, rpy = ([float(number) for number in origin.get(key).split()] for key in ("xyz", "rpy"))
    T = np.eye(4)
    T[:3, :3] = (
        Rotation.from_rotvec([0, 0, rpy[2]])
        * Rotation.from_rotvec([0, rpy[1], 0])
        * Rotation.from_rotvec([rpy[0], 0, 0])
    ).as_matrix()
    T[:3, 3] = xyz
    return T


@settings(max_examples=30)
@given(places)
def test_frames_of_a_urdf_lead_to_the_cameras(place) -> None:
    camera = Camera(640, 480, 500.0, 500.0, 320.0, 240.0, T_rs=pose.from_rotation_vector(*place))
    robot = ElementTree.fromstring(urdf.write({"tof": camera}).text.partition("\n")[2])
    joints = {joint.find("child").get("link"): joint for joint in robot.iter("joint")}  # pyright: ignore[reportOptionalMemberAccess]
    T_rs = _origin(joints["tof_link"]) @ _origin(joints["tof_optical_frame"])
    np.testing.assert_allclose(T_rs, camera.T_rs, atol=1e-9)
    assert {link.get("name") for link in robot.iter("link")} == {"rig", "tof_link", "tof_optical_frame"}
    # The link's x axis is the optical axis.
    np.testing.assert_allclose(_origin(joints["tof_optical_frame"])[:3, :3] @ (0, 0, 1), (1, 0, 0), atol=1e-12)
    transform = yaml.safe_load(tf.write({"tof": camera}).text)["transforms"][0]["transform"]
    turned = Rotation.from_quat(list(transform["rotation"].values())).as_matrix()
    np.testing.assert_allclose(turned, camera.T_rs[:3, :3], atol=1e-9)
