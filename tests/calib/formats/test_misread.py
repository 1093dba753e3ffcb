"""Files that were read wrongly without a word, or not at all."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from abs_service.calibration.files import exchange
from calib import pose
from calib.camera import Camera
from calib.formats import kalibr, opencv, ros
from calib.formats.content import FormatError, Hints
from calib.formats.plausibility import doubts

_MESSAGE = """
header:
  frame_id: color
height: 480
width: 640
distortion_model: plumb_bob
d: [0.1, -0.2, 0.001, 0.002, 0.0]
k: [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]
r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
p: [500.0, 0.0, 320.0, 0.0, 0.0, 501.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
---
"""

_MATRIX = np.array([[500.0, 0, 320], [0, 501, 240], [0, 0, 1]])
_PLACE = np.array([[-0.09], [0.0], [0.02]])


@pytest.mark.parametrize(
    "text", [_MESSAGE, _MESSAGE.replace("\nd:", "\nD:").replace("\nk:", "\nK:").replace("\np:", "\nP:")]
)
def test_a_camera_info_may_be_a_message(text: str) -> None:
    assert exchange.of_content(Path("info.yaml"), text) == "ros"
    content = ros.read(text, Hints())
    camera = content.cameras["color"]
    assert (camera.width, camera.height, camera.fx, camera.cy) == (640, 480, 500, 240)
    assert camera.lens.coefficients[:4].tolist() == [0.1, -0.2, 0.001, 0.002]
    assert content.lost == ()


@pytest.mark.parametrize("before", ["---", "# by camera_calibration\n---\n", "%YAML 1.1\n---\n"])
def test_a_camera_info_may_begin_with_a_marker(before: str) -> None:
    (camera,) = ros.read(before + _MESSAGE.replace("---\n", ""), Hints()).cameras.values()
    assert camera.width == 640


def test_the_first_of_several_messages_is_read() -> None:
    (camera,) = ros.read(_MESSAGE + _MESSAGE.replace("width: 640", "width: 320"), Hints()).cameras.values()
    assert camera.width == 640


def test_a_transposed_pose_is_refused() -> None:
    T_rl = pose.from_rotation_vector((0, 0.3, 0), _PLACE.ravel())
    cam = "camera_model: pinhole, distortion_coeffs: [], distortion_model: none, intrinsics: [500, 501, 320, 240]"
    chain = f"cam0: {{{cam}, resolution: [640, 480]}}\ncam1: {{{cam}, resolution: [640, 480], T_cn_cnm1: %s}}"
    assert len(kalibr.read(chain % T_rl.tolist(), Hints()).cameras) == 2
    with pytest.raises(FormatError, match=r"cam1: the last row of a pose is 0 0 0 1, not .*transposed"):
        kalibr.read(chain % T_rl.T.tolist(), Hints())


def test_a_rotation_that_the_rectification_contradicts_is_refused() -> None:
    turn, lens = cv2.Rodrigues(np.array([0, 0.3, 0.02]))[0], np.array([-0.2, 0.05, 0, 0, 0])
    first, second = cv2.stereoRectify(_MATRIX, lens, _MATRIX, lens, (640, 480), turn, _PLACE)[:2]
    assert len(opencv.read(_stereo(turn, R1=first, R2=second), Hints(size=(640, 480))).cameras) == 2
    with pytest.raises(FormatError, match=r"R does not fit R1 and R2 .* is R transposed"):
        opencv.read(_stereo(turn.T, R1=first, R2=second), Hints(size=(640, 480)))


def _stereo(turn: np.ndarray, **more: np.ndarray) -> str:
    storage = cv2.FileStorage("", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML)
    for key, value in {"M1": _MATRIX, "M2": _MATRIX, "R": turn, "T": _PLACE, **more}.items():
        storage.write(key, value)
    return storage.releaseAndGetString()


@pytest.mark.parametrize(
    "dialect", [cv2.FILE_STORAGE_FORMAT_YAML, cv2.FILE_STORAGE_FORMAT_XML, cv2.FILE_STORAGE_FORMAT_JSON]
)
def test_arrays_of_one_axis_are_read_as_opencv_5_writes_them(dialect: int) -> None:
    storage = cv2.FileStorage("", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | dialect)
    storage.write("image_size", np.array([640, 480]))
    storage.write("camera_matrix", _MATRIX)
    storage.write("distortion_coefficients", np.array([-0.2, 0.05, 0.001, 0.002, 0.01]))
    text = storage.releaseAndGetString()
    assert "opencv-nd-matrix" in text
    (camera,) = opencv.read(text, Hints()).cameras.values()
    assert (camera.width, camera.height, camera.fy) == (640, 480, 501)
    assert camera.lens.coefficients[:5].tolist() == [-0.2, 0.05, 0.001, 0.002, 0.01]


def test_exchanged_width_and_height_are_named() -> None:
    (said,) = doubts({"color": Camera(480, 640, 500.0, 500.0, 321.0, 238.0)})
    assert "is in the middle of images of 640 × 480 pixels, not of 480 × 640" in said
    assert not doubts({"color": Camera(640, 480, 500.0, 500.0, 321.0, 238.0)})
    assert not doubts({"color": Camera(480, 480, 500.0, 500.0, 321.0, 238.0)})  # cropped


def test_the_baseline_in_a_camera_info_is_listed_as_lost() -> None:
    info = ros.write({"right": Camera(640, 480, 500, 500, 320, 240)}).text
    assert not ros.read(info, Hints()).lost
    (lost,) = ros.read(info.replace("320.0, 0.0, 0.0, 500.0", "320.0, -50.0, 0.0, 500.0"), Hints()).lost
    assert "it stands 0.1 m beside another camera" in lost
