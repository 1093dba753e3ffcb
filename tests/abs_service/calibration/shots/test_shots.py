"""Shots from recordings, folders and devices, and what they show of a board, against the simulator's truth."""

import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from abs_service.calibration.shots.corner_extraction import BoardObservations, see
from abs_service.calibration.shots.live_shots import LiveShots, NamedDevice
from abs_service.calibration.shots.shot_sources import FolderShots, RecordingShots
from abs_service.calibration.shots.shots import SensorShot, Shot, ShotsError
from calib import pose
from calib.board.corners import errors
from calib.camera import Camera
from calib.pose import Pose
from drivers.contract.frame import Reference
from drivers.opening import open_device
from drivers.replay.recording import Recording
from evaluation.calibration.simulated_board import Filmed, record, scene
from evaluation.scenes.boards.board_images import VGA, as_bytes, centered, photograph

CHESSBOARD = scene("chessboard", "sensors=tof,structured_light,color", "rate=6", "seed=2", "color=640x480", "hold=1")


def plane_error(pixels, distances, camera: Camera, T_rb: Pose) -> np.ndarray:
    """Measured distances less those of a plane [m]."""
    T_sb = camera.T_sr @ T_rb
    normal = T_sb[:3, 2]
    return distances - (normal @ T_sb[:3, 3]) / (camera.directions(pixels) @ normal)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("shots") / "board.mcap"
    return Recording(record(Filmed(CHESSBOARD.simulation, 26), path))


@pytest.fixture(scope="module")
def seen(recording: Recording) -> BoardObservations:
    shots = RecordingShots(recording, every_s=0.1)
    return sum((see(CHESSBOARD.target, shot, recording.cameras) for shot in shots), BoardObservations())


@pytest.mark.slow
def test_a_recording_shows_corners_and_planes_where_they_truly_are(
    recording: Recording, seen: BoardObservations
) -> None:
    simulation = CHESSBOARD.simulation
    assert {view.sensor for view in seen.corners} == {"tof", "color"}
    assert {view.sensor for view in seen.planes} == {"tof", "structured_light"}
    assert seen.sizes == {"tof": (176, 144), "color": (640, 480), "structured_light": (320, 240)}
    for view in seen.corners:
        T_rb = CHESSBOARD.true_pose(simulation, view.t_s)
        true = recording.cameras[view.sensor].project(pose.transform(T_rb, view.points_b))
        assert np.sqrt(np.mean((view.pixels - true) ** 2)) < 0.15
    for view in seen.planes:
        error = plane_error(
            view.pixels, view.distances, recording.cameras[view.sensor], CHESSBOARD.true_pose(simulation, view.t_s)
        )
        assert abs(error.mean()) < 0.003
        assert 0.6 < np.sqrt(np.mean(np.square(error / view.sigmas))) < 1.6


class Stamped(Filmed):
    """Exposures of 4 ms, of which those of colour are stamped at the end and the others at the start."""

    def frames(self):
        for frame in super().frames():
            at = Reference.END if frame.sensor == "color" else Reference.START
            yield replace(frame, t_reference=at, exposure_s=0.004)


def test_times_of_shots_are_those_of_the_middle_of_their_exposures(tmp_path: Path) -> None:
    small = scene("chessboard", "sensors=tof,color", "rate=6", "color=160x120", "hold=1").simulation
    given, stamped = (
        next(iter(RecordingShots(Recording(record(films, tmp_path / f"{films.__class__.__name__}.mcap")))))
        for films in (Filmed(small, 3), Stamped(small, 3))
    )
    for sensor, after_s in (("tof", 0.002), ("color", -0.002)):
        apart = stamped.sensor_shots[sensor].t_ns - given.sensor_shots[sensor].t_ns
        assert apart == pytest.approx(after_s * 1e9, abs=1e3)


@pytest.mark.slow
def test_a_board_that_moves_is_refused_and_one_that_is_held_is_not(seen: BoardObservations) -> None:
    rejected = {shot for (shot, sensor), why in seen.rejected.items() if isinstance(why, errors.MovedError)}
    held = {view.shot for view in seen.corners if view.sensor == "color"}
    # Of every twelve exposures, the first six are still; shot n is exposure n + 1 and is compared with exposure n.
    assert held >= {0, 1, 2, 3, 4, 12, 13, 14, 15, 16, 24}
    assert rejected >= {7, 8, 9}
    assert not held & {7, 8, 9, 19, 20, 21}


def test_a_recording_without_images_is_refused(tmp_path: Path) -> None:
    path = record(Filmed(scene("circles", "sensors=barrier").simulation, 2), tmp_path / "beam.mcap")
    with pytest.raises(ShotsError, match=r"beam\.mcap: no image in it shows a board: barrier/binary"):
        list(RecordingShots(Recording(path)))


def write(folder: Path, name: str, distance: float) -> None:
    T_sb = centered(CHESSBOARD.target, (0.2, 0.1, 0), distance)
    cv2.imwrite(str(folder / name), as_bytes(photograph(CHESSBOARD.target, VGA, T_sb)))


def test_images_in_folders_are_paired_by_the_last_number_in_their_names(tmp_path: Path) -> None:
    for name, distance in (("left02.png", 0.7), ("left10.png", 0.8), ("r_2.png", 0.9), ("r_3.png", 0.75)):
        write(tmp_path, name, distance)
    shots = list(FolderShots({"left": f"{tmp_path}/left*.png", "right": f"{tmp_path}/r_*.png"}))
    assert [(shot.number, sorted(shot.sensor_shots)) for shot in shots] == [
        (2, ["left", "right"]),
        (3, ["right"]),
        (10, ["left"]),
    ]
    seen = sum((see(CHESSBOARD.target, shot, {}) for shot in shots), BoardObservations())
    assert [(view.shot, view.sensor) for view in seen.corners] == [
        (2, "left"),
        (2, "right"),
        (3, "right"),
        (10, "left"),
    ]


def test_images_of_one_sensor_may_have_times_in_their_names(tmp_path: Path) -> None:
    for name in ("l_10-30-50.png", "l_10-29-50.png"):
        write(tmp_path, name, 0.7)
    alone = {"left": f"{tmp_path}/l_*.png"}
    files = [shot.sensor_shots["left"].file for shot in FolderShots(alone)]
    assert [file and file.name for file in files] == ["l_10-29-50.png", "l_10-30-50.png"]
    write(tmp_path, "r_10-31-51.png", 0.7)
    with pytest.raises(ShotsError, match=r"images of left: .* such as in l_10-29-50.png, .*let the last one count"):
        list(FolderShots({**alone, "right": f"{tmp_path}/r_*.png"}))


def test_times_in_names_tell_which_images_of_two_sensors_belong_together(tmp_path: Path) -> None:
    for name in ("cam0_102950_601", "cam0_103050_601", "cam0_103050_700", "cam1_103050_700", "cam1_103050_601"):
        write(tmp_path, f"{name}.png", 0.7)
    write(tmp_path, "cam1_103055_601.png", 0.7)
    shots = list(FolderShots({"left": f"{tmp_path}/cam0_*.png", "right": f"{tmp_path}/cam1_*.png"}))
    names = [{sensor: one.file.stem[5:] for sensor, one in shot.sensor_shots.items() if one.file} for shot in shots]
    assert [shot.number for shot in shots] == [0, 1, 2, 3]
    assert names == [
        {"left": "102950_601"},
        {"left": "103050_601", "right": "103050_601"},
        {"left": "103050_700", "right": "103050_700"},
        {"right": "103055_601"},
    ]


def test_what_is_no_image_is_named(tmp_path: Path) -> None:
    (tmp_path / "left01.png").write_bytes(b"nothing")
    with pytest.raises(ShotsError, match=r"left01\.png: cannot be read as an image"):
        list(FolderShots({"left": f"{tmp_path}/left*.png"}))
    with pytest.raises(ShotsError, match=r"images of right: .*no file matches 'right\*\.png'"):
        list(FolderShots({"right": f"{tmp_path}/right*.png"}))


def test_devices_deliver_the_newest_shot() -> None:
    device = open_device("simulated://target?speed=0&sensors=tof,color&rate=20", time.monotonic_ns)
    wired = {"sim": NamedDevice(device, {"tof": "depth_camera", "color": "color"})}
    with LiveShots(wired, device.cameras, 12_000_000, time.monotonic_ns) as shots:
        first, second = (shot for shot, _ in zip(shots, range(2)))
    assert set(first.sensor_shots) == {"depth_camera", "color"}
    assert first.sensor_shots["depth_camera"].distance.shape == (144, 176)
    assert second.t_ns > first.t_ns
    assert second.number == 1


def test_a_device_that_fails_ends_the_shots_with_its_reason() -> None:
    device = open_device("simulated://target?fault=unplug@3&sensors=tof&rate=50", time.monotonic_ns)
    with (
        LiveShots({"sim": NamedDevice(device, {"tof": "tof"})}, device.cameras, 12_000_000, time.monotonic_ns) as shots,
        pytest.raises(ShotsError, match="device sim failed"),
    ):
        list(shots)


def test_wildcards_of_a_folder_are_refused_unless_they_are_its_name(tmp_path: Path) -> None:
    folder = tmp_path / "run [1]"
    folder.mkdir()
    cv2.imwrite(f"{folder}/left1.png", np.zeros((4, 4), np.uint8))
    assert len(list(FolderShots({"left": f"{folder}/*.png"}))) == 1
    with pytest.raises(ShotsError, match=r"run\*: no such folder; only the name of the images, .* may hold wildcards"):
        list(FolderShots({"left": f"{tmp_path}/run*/left*.png"}))


def test_z_distances_without_a_camera_are_refused(recording: Recording) -> None:
    with pytest.raises(ShotsError, match="structured_light/depth: distances along z need the camera model"):
        list(RecordingShots(recording, cameras={"tof": recording.cameras["tof"]}))


def test_a_saturated_amplitude_is_refused_although_its_corners_are_found() -> None:
    T_sb = centered(CHESSBOARD.target, (0.3, 0.2, 0), 0.7)
    image = photograph(CHESSBOARD.target, VGA, T_sb, black=0.2, white=1.3, noise=0.01)
    amplitude = np.clip(4095 * image, 0, 4095).astype(np.uint16)
    shot = Shot(0, {"tof": SensorShot(0, amplitude, amplitude, own_light=True)})
    (why,) = see(CHESSBOARD.target, shot, {}).rejected.values()
    assert isinstance(why, errors.SaturatedError)
