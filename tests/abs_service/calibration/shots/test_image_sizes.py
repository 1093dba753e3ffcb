"""Images of another size than the sensor's others, or than its stored camera is for, are refused with both sizes."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from abs_service import cli
from abs_service.calibration.files import rig_file, target_file
from abs_service.calibration.shots import image_sizes
from abs_service.calibration.shots.shots import NO_IMAGE, SensorShot, Shot, ShotsError
from abs_service.report.provenance import Provenance
from abs_service.supervision.exit_codes import Exit
from calib.board.target import Chessboard
from calib.camera import Camera


def look(width: int, distances: int) -> SensorShot:
    """A sensor's square image and distances; 0 for none."""
    image = np.zeros((width, width), np.uint8) if width else NO_IMAGE
    return SensorShot(0, image, image, distance=np.ones((distances, distances), np.float32))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three images of one camera, of which the last is half as large, beside a board and a calibration."""
    monkeypatch.chdir(tmp_path)
    for number, size in ((1, (64, 48)), (2, (64, 48)), (3, (32, 24))):
        cv2.imwrite(f"left{number}.png", np.full((size[1], size[0]), 128, np.uint8))
    target_file.write(Chessboard(9, 6, 0.03), Path("board.toml"))
    sensors = {"left": rig_file.SensorCalibration(Camera(64, 48, 50.0, 50.0, 32.0, 24.0))}
    rig_file.write(rig_file.RigCalibration("lab", sensors, Provenance("x", "2026-11-21"), "good"), Path("lab.toml"))
    return tmp_path


@pytest.mark.parametrize("command", [["rig"], ["intrinsics", "--sensor", "left"]])
def test_a_calibration_refuses_images_of_two_sizes(folder: Path, capsys, command: list[str]) -> None:
    given = ["--images", "left=left*.png", "--target", "board.toml", "--out", "out.toml"]
    assert cli.main(["calibrate", *command, *given]) == Exit.USER
    said = capsys.readouterr().err
    assert "left3.png: the image of left is 32 × 24 pixels, but 64 × 48 pixels in left1.png" in said
    assert "--skip 3" in said
    assert not (folder / "out.toml").exists()


def test_of_two_sizes_all_images_of_the_rarer_one_are_named(folder: Path, capsys) -> None:
    for number, size in ((0, (32, 24)), (4, (64, 48)), (5, (64, 48)), (6, (16, 12))):
        cv2.imwrite(f"left{number}.png", np.full((size[1], size[0]), 128, np.uint8))
    given = ["--images", "left=left*.png", "--target", "board.toml", "--out", "out.toml"]
    assert cli.main(["calibrate", "intrinsics", *given]) == Exit.USER
    assert capsys.readouterr().err.endswith("such as by --skip 0,3,6\n")


def test_a_verification_refuses_images_that_the_stored_camera_is_not_for(folder: Path, capsys) -> None:
    given = ["--images", "left=left3*.png", "--target", "board.toml"]
    assert cli.main(["calibrate", "verify", "lab.toml", *given]) == Exit.USER
    said = capsys.readouterr().err
    assert "left3.png: the image of left is 32 × 24 pixels, but its camera in lab.toml is for 64 × 48 pixels" in said


def test_an_image_of_the_size_of_another_sensor_asks_whether_names_are_exchanged() -> None:
    cameras = {name: Camera(width, width, 9.0, 9.0, 4.0, 4.0) for name, width in (("tof", 8), ("color", 6))}
    with pytest.raises(ShotsError, match=r"that is the size of color: are the names exchanged\?"):
        list(image_sizes.checked_for([Shot(1, {"tof": look(6, 0)})], cameras, Path("lab.toml")))


def test_a_shot_without_an_image_is_no_other_size() -> None:
    shots = [Shot(number, {"tof": look(width, 4)}) for number, width in enumerate((8, 0, 8))]
    assert list(image_sizes.checked(shots)) == shots
    with pytest.raises(ShotsError, match=r"shot 1: the image of tof is 6 × 6 pixels, but 8 × 8 pixels in shot 0"):
        list(image_sizes.checked([shots[0], Shot(1, {"tof": look(6, 4)})]))


def test_an_image_that_was_turned_is_told_from_one_of_another_size() -> None:
    images = [np.zeros(shape, np.uint8) for shape in ((6, 8), (8, 6))]
    shots = [Shot(number, {"color": SensorShot(0, image, image)}) for number, image in enumerate(images)]
    with pytest.raises(ShotsError, match=r"Was it turned by 90°\? Then turn it back, or leave out"):
        list(image_sizes.checked(shots))
