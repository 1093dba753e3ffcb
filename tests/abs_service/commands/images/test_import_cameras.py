"""Calibrations of other programs are camera files, and what they say wrongly is told."""

from pathlib import Path

import numpy as np
import pytest

from abs_service.supervision.exit_codes import Exit
from drivers.replay import Recording
from tests.abs_service.commands.images.importing import CAMERA, COLOR, run

ROS = """\
image_width: 4
image_height: 3
camera_name: rgb
camera_matrix: {rows: 3, cols: 3, data: [4.0, 0.0, 1.5, 0.0, 5.0, 1.0, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.01, 0.0, 0.0, 0.0]}
"""
OPENCV = """\
%YAML:1.0
---
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 4., 0., 1.5, 0., 5., 1., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.1, 0.01, 0., 0., 0. ]
"""
OPEN3D = '{"width": 4, "height": 3, "intrinsic_matrix": [4.0, 0, 0, 0, 5.0, 0, 1.5, 1.0, 1]}'
OURS = """\
version = 1
name = "lab"

[provenance]
command = "abs-service calibrate rig"
date = "2026-11-21T12:00:00Z"
version = "0.1.0"
verdict = "good"
data = []

[sensors.depth.camera]
width = 4
height = 3
fx = 4.0
fy = 5.0
cx = 1.5
cy = 1.0

[sensors.color.camera]
width = 4
height = 3
fx = 4.0
fy = 5.0
cx = 1.5
cy = 1.0
T_rs = { translation = [0.05, 0.0, 0.0] }
"""
KALIBR = """\
cam0:
  camera_model: pinhole
  intrinsics: [4.0, 5.0, 1.5, 1.0]
  distortion_model: radtan
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [4, 3]
cam1:
  camera_model: pinhole
  intrinsics: [4.0, 5.0, 1.5, 1.0]
  distortion_model: radtan
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [4, 3]
  T_cn_cnm1: [[1.0, 0.0, 0.0, -0.05], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
"""


@pytest.mark.parametrize(
    ("name", "text", "lens", "baseline"),
    [
        ("K.txt", "4.0 0.0 1.5\n0.0 5.0 1.0\n0.0 0.0 1.0\n", 0.0, 0.0),
        ("intrinsic_depth.txt", "4 0 1.5 0\n0 5 1 0\n0 0 1 0\n0 0 0 1\n", 0.0, 0.0),
        ("K.csv", "[[4, 0, 1.5],\n [0, 5, 1],\n [0, 0, 1]]\n", 0.0, 0.0),
        ("flat.txt", "\ufeff4 0 1.5 0 5 1 0 0 1\n", 0.0, 0.0),
        ("camera_info.yaml", ROS, -0.1, 0.0),
        ("camera.yml", OPENCV, -0.1, 0.0),
        ("intrinsics.json", OPEN3D, 0.0, 0.0),
        ("lab.calibration.toml", OURS, 0.0, 0.05),
    ],
)
def test_a_calibration_of_another_program_is_a_camera_file(folder: Path, name, text, lens, baseline) -> None:
    (folder / name).write_text(text)
    assert run(folder, "--camera", str(folder / name)) == Exit.OK
    cameras = Recording(folder / "out.mcap").cameras
    for camera in (cameras["depth"], cameras["color"]):
        assert (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) == (4, 3, 4, 5, 1.5, 1)
        assert camera.lens.coefficients[0] == lens
    np.testing.assert_allclose(cameras["color"].center, [baseline, 0, 0])


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        (
            "camchain.yaml",
            KALIBR,
            "has the cameras cam0, cam1, of which one has to be called depth and one color; `abs-",
        ),
        ("K.txt", "4.0 0.0 1.5\n0.0 5.0 1.0\n", "K.txt: its format is none of a matrix of 3 × 3 numbers, "),
        ("K.txt", "4 0 0\n0 5 0\n1.5 1 1\n", "K.txt: a camera matrix is [[fx, skew, cx], [0, fy, cy], [0, 0, 1]], not"),
        ("camera_info.yaml", ROS.replace("1.5", "150.0"), "its principal point (150, 1) is outside of its images of 4"),
    ],
)
def test_a_calibration_that_does_not_say_which_camera_it_is_for_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], name, text, complaint
) -> None:
    (folder / name).write_text(text)
    assert run(folder, "--camera", str(folder / name)) == Exit.USER
    assert complaint in capsys.readouterr().err


def test_one_camera_without_colour_images_is_that_of_depth(folder: Path) -> None:
    for path in folder.glob("color_*"):
        path.unlink()
    (folder / "K.txt").write_text("4 0 1.5\n0 5 1\n0 0 1\n")
    assert run(folder, "--camera", str(folder / "K.txt")) == Exit.OK
    assert {*Recording(folder / "out.mcap").cameras} == {"depth"}


@pytest.mark.parametrize(
    ("changes", "doubt"),
    [
        (("fx = 4.0", "fx = 0.01"), "depth: its field of view is 179° × 41.1°. Are fx = 0.01 and fy = 4 in pixels of"),
        (("cx = 1.5", "cx = 9.0"), "depth: its principal point (9, 1) is outside of its images of 4 × 3 pixels."),
    ],
)
def test_intrinsics_that_no_camera_has_are_told(folder: Path, capsys, changes, doubt) -> None:
    (folder / "camera.toml").write_text(CAMERA.replace(*changes))
    assert run(folder, "--camera", str(folder / "camera.toml")) == Exit.OK
    assert f"note: {folder / 'camera.toml'}: {doubt}" in capsys.readouterr().err


def test_the_side_of_the_colour_camera_is_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(folder, "--camera", str(folder / "camera.toml")) == Exit.OK
    assert "depth, color: 50.0 mm apart, turned by 0.00°, color to the right of depth" in capsys.readouterr().out


def test_a_pose_in_millimetres_is_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "camera.toml").write_text(CAMERA + COLOR.replace("0.05", "50.0"))
    assert run(folder, "--camera", str(folder / "camera.toml")) == Exit.OK
    assert "depth, color are 50 m apart: is the translation of T_rs in metres?" in capsys.readouterr().err
