"""Formats of other programs: samples checked by hand, and refusal of what cannot be expressed."""

import json
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from calib import pose
from calib.camera import Camera
from calib.formats import depthai, kalibr, mrcal, opencv, ros
from calib.formats.content import FormatError, Hints
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens

HINTS = Hints("tof")


CAMCHAIN = """
cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 7e-2, 1e-05, 2e-4]
  distortion_model: radtan
  intrinsics: [458.5, 457.5, 367.25, 248.5]
  resolution: [752, 480]
  rostopic: /camera/left/image_raw
  timeshift_cam_imu: 0.001
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 0.0, 1.0, 0.01]
  - [0.0, -1.0, 0.0, 0.02]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [0.01, 0.02, 0.03, 0.04]
  distortion_model: equidistant
  intrinsics: [457.0, 456.0, 379.0, 255.0]
  resolution: [752, 480]
  rostopic: /camera/right/image_raw
"""


def test_a_chain_of_kalibr_by_hand() -> None:
    content = kalibr.read(CAMCHAIN, HINTS)
    left, right = content.cameras["cam0"], content.cameras["cam1"]  # both topics begin with "camera"
    assert left.lens.coefficients[:4].tolist() == [-0.28, 0.07, 1e-5, 2e-4]
    assert isinstance(right.lens, KannalaBrandt)
    assert content.lost == ("cam0: timeshift_cam_imu",)
    # The origin of cam1 is where T_cn_cnm1 gives zero: x = 0.11, z = −0.01, −y = −0.02.
    np.testing.assert_allclose(right.center, (0.11, 0.02, -0.01), atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("camera_model: pinhole", "camera_model: omni", "cam0: the projection omni"),
        ("radtan", "fov", "cam0: the distortion fov"),
        ("  resolution: [752, 480]\n", "", "cam0: resolution is missing"),
        ("458.5", "-458.5", "cam0: no camera: fx = -458.5.*: must be positive"),
        ("[1.0, 0.0, 0.0, -0.11]", "[2.0, 0.0, 0.0, -0.11]", "cam1: not a pose"),
        ("cam", "kam", "no camera chain"),
        ("cam0:", "cam0: [", "not YAML"),
    ],
)
def test_what_is_wrong_with_a_chain_is_named(old: str, new: str, said: str) -> None:
    with pytest.raises(FormatError, match=said):
        kalibr.read(CAMCHAIN.replace(old, new), HINTS)


CAMERA_INFO = """
image_width: 640
image_height: 480
camera_name: color
camera_matrix:
  rows: 3
  cols: 3
  data: [500.5, 0, 320.25, 0, 501.5, 240.75, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.2, 1e-3, 2e-3, 0.3]
rectification_matrix:
  rows: 3
  cols: 3
  data: [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [500.5, 0, 320.25, 0, 0, 501.5, 240.75, 0, 0, 0, 1, 0]
"""


def test_a_camera_info_by_hand() -> None:
    content = ros.read(CAMERA_INFO, HINTS)
    camera = content.cameras["color"]
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (500.5, 501.5, 320.25, 240.75)
    assert camera.lens.coefficients.tolist() == [0.1, -0.2, 0.001, 0.002, 0.3, 0, 0, 0]
    assert "not rectified" in content.lost[0]
    for model, wrong in (("plumb_bob", "double_sphere"), ("image_width: 640\n", "")):
        with pytest.raises(FormatError):
            ros.read(CAMERA_INFO.replace(model, wrong), HINTS)


CAMERAMODEL = """# written by hand
{
    'lensmodel':  'LENSMODEL_OPENCV4',
    # fx, fy, cx, cy, k1, k2, p1, p2
    'intrinsics': [ 1000., 1001., 639.5, 359.5, -0.1, 0.02, 0.001, -0.002,],
    'valid_intrinsics_region': [ [0, 0], [0, 719], ],
    # rt_fromref
    'extrinsics': [ 0, 0, 1.5707963267948966, 1, 2, 3,],
    'imagersize': [ 1280, 720,],
    'icam_intrinsics': 0,
}
"""


def test_a_camera_model_of_mrcal_by_hand() -> None:
    content = mrcal.read(CAMERAMODEL, HINTS)
    camera = content.cameras["tof"]
    # A quarter turn about z takes the reference's x to the camera's y; the camera's centre is −Rᵀ t.
    np.testing.assert_allclose(camera.T_sr[:3, :3] @ (1, 0, 0), (0, 1, 0), atol=1e-12)
    np.testing.assert_allclose(camera.center, (-2, 1, -3), atol=1e-12)
    assert content.lost == ("tof: valid_intrinsics_region, icam_intrinsics",)
    for wrong in ("LENSMODEL_CAHVOR", "LENSMODEL_OPENCV8"):
        with pytest.raises(FormatError, match=wrong):
            mrcal.read(CAMERAMODEL.replace("LENSMODEL_OPENCV4", wrong), HINTS)
    for wrong in ("", "{", "[1]", "{}", "__import__('os')"):
        with pytest.raises(FormatError, match="no camera model of mrcal"):
            mrcal.read(wrong, HINTS)


def test_a_calibration_of_depthai_by_hand() -> None:
    """Right (socket 2) leads to left (1), which leads to colour (0); lengths in centimetres."""
    link = {"rotationMatrix": np.eye(3).tolist(), "specTranslation": {"x": 0, "y": 0, "z": 0}}
    table = {
        "cameraType": 0, "distortionCoeff": [0.1] + [0.0] * 13, "height": 800, "width": 1280,
        "intrinsicMatrix": [[800.0, 0, 640.0], [0, 801.0, 400.0], [0, 0, 1]],
    }  # fmt: skip
    nowhere = {"rotationMatrix": [], "toCameraSocket": -1, "translation": {"x": 0, "y": 0, "z": 0}}
    to_color = link | {"toCameraSocket": 0, "translation": {"x": 3.75, "y": 0.5, "z": 0}}
    to_left = link | {"toCameraSocket": 1, "translation": {"x": -75.0, "y": 0, "z": 0}, "lengthUnit": 2}
    data = [[2, table | {"extrinsics": to_left}], [0, table | {"extrinsics": nowhere}]]
    data.append([1, table | {"extrinsics": to_color, "cameraType": 1}])
    found = depthai.read(json.dumps({"cameraData": data}), HINTS).cameras
    assert list(found) == ["cam_a", "cam_b", "cam_c"]
    assert isinstance(found["cam_b"].lens, KannalaBrandt)
    np.testing.assert_allclose(found["cam_b"].center, (0.0375, 0.005, 0), atol=1e-12)
    np.testing.assert_allclose(found["cam_c"].center, (-0.0375, 0.005, 0), atol=1e-12)


@pytest.mark.parametrize("wrong", ["", "{}", "[]", '{"cameraData": [[0, {"intrinsicMatrix": [[1]]}]]}'])
def test_what_is_no_calibration_of_depthai_is_refused(wrong: str) -> None:
    with pytest.raises(FormatError, match="no calibration of DepthAI"):
        depthai.read(wrong, HINTS)


def test_depthai_itself_reads_what_we_write() -> None:
    dai = pytest.importorskip("depthai")
    color = Camera(1280, 800, 800.0, 801.0, 640.5, 400.25, Lens(np.array([0.1, -0.2])))
    left = Camera(
        640, 400, 400.0, 401.0, 320.0, 200.0, T_rs=pose.from_rotation_vector((0.1, 0.2, 0.3), (0.075, 0.01, 0))
    )
    handler = dai.CalibrationHandler.fromJson(json.loads(depthai.write({"color": color, "left": left}).text))
    sockets = dai.CameraBoardSocket.CAM_B, dai.CameraBoardSocket.CAM_A
    T_color_left = np.array(handler.getCameraExtrinsics(*sockets))
    T_color_left[:3, 3] /= 100
    np.testing.assert_allclose(T_color_left, left.T_rs, atol=1e-6)
    np.testing.assert_allclose(handler.getCameraIntrinsics(sockets[1])[0], (800, 0, 640.5))


def test_opencv_finds_a_stereo_pair() -> None:
    storage = cv2.FileStorage("", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML)
    for side in "12":
        storage.write(f"M{side}", np.array([[500.0, 0, 320], [0, 501, 240], [0, 0, 1]]))
        storage.write(f"D{side}", np.array([[0.1, 0.2, 0, 0, float(side)]]))
    text = storage.releaseAndGetString()
    hints = Hints(size=(640, 480))
    assert "R and T are missing" in opencv.read(text, hints).lost[0]
    turned = pose.from_rotation_vector((0, 0.1, 0), (0, 0, 0))[:3, :3]
    placed = text + "R: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: " + str(turned.ravel().tolist())
    placed += "\nT: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [-60., 1., 2.]\n"
    found = opencv.read(placed, hints).cameras
    np.testing.assert_allclose(found["right"].T_sr[:3, 3], (-60, 1, 2), atol=1e-9)
    np.testing.assert_allclose(found["right"].T_sr[:3, :3], turned, atol=1e-9)
    assert (found["left"].lens.coefficients[4], found["right"].lens.coefficients[4]) == (1, 2)
    with pytest.raises(FormatError, match="--size"):
        opencv.read(text, HINTS)


def _one_camera(**values: Any) -> str:
    storage = cv2.FileStorage("", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML)
    storage.write("camera_matrix", np.array([[500.0, 0, 320], [0, 501, 240], [0, 0, 1]]))
    for key, value in values.items():
        storage.write(key, value)
    return storage.releaseAndGetString()


def test_a_lens_under_another_name_is_no_lens_without_distortion() -> None:
    hints, lens = Hints(size=(640, 480)), np.array([[0.1, 0.2, 0, 0, 0.3]])
    found = opencv.read(_one_camera(dist_coeff=lens), hints)
    assert found.cameras["camera"].lens.coefficients[4] == 0.3
    assert not found.lost
    with pytest.raises(FormatError, match=r"lensDistortion: is this the lens\?"):
        opencv.read(_one_camera(lensDistortion=lens), hints)


def test_a_calibration_that_failed_in_opencv_is_refused() -> None:
    lens = np.zeros((5, 1))
    assert opencv.read(_one_camera(distCoeffs=lens, avg_reprojection_error=0.4), Hints(size=(640, 480))).cameras
    with pytest.raises(FormatError, match="corners missed by 190 px"):
        opencv.read(_one_camera(distCoeffs=lens, avg_reprojection_error=190.0), Hints(size=(640, 480)))


def test_poses_of_kalibr_may_stand_in_one_row() -> None:
    camera = {"camera_model": "pinhole", "intrinsics": [500, 500, 320, 240], "distortion_model": "radtan"}
    camera |= {"distortion_coeffs": [0, 0, 0, 0], "resolution": [640, 480]}
    T = [1.0, 0, 0, -0.32, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    found = kalibr.read(yaml.safe_dump({"cam0": camera, "cam1": camera | {"T_cn_cnm1": T}}), HINTS).cameras
    np.testing.assert_allclose([one.T_rs[0, 3] for one in found.values()], [0, 0.32])


@pytest.mark.parametrize("text", ["", "%YAML:1.0\n---\na: 1\n", "hello", "%YAML:1.0\n---\nM: [\n"])
def test_what_is_no_camera_of_opencv_is_refused(text: str) -> None:
    with pytest.raises(FormatError):
        opencv.read(text, Hints(size=(640, 480)))


def test_lenses_that_a_format_lacks_are_refused_and_never_cut_off() -> None:
    rational = Camera(640, 480, 500.0, 500.0, 320.0, 240.0, Lens(np.arange(1, 9) / 100))
    wide = Camera(640, 480, 300.0, 300.0, 320.0, 240.0, KannalaBrandt(np.array([0.1])))
    with pytest.raises(FormatError, match="k3"):
        kalibr.write({"tof": rational})
    with pytest.raises(FormatError, match="no fisheye"):
        mrcal.write({"tof": wide})
    with pytest.raises(FormatError, match="one of tof, color"):
        ros.write({"tof": wide, "color": wide})
    prism = yaml.safe_load(CAMERA_INFO) | {
        "distortion_model": "rational_polynomial", "distortion_coefficients": {"data": [0.1] * 12}
    }  # fmt: skip
    with pytest.raises(FormatError, match="thin prism"):
        ros.read(yaml.safe_dump(prism), HINTS)
