"""Guided capture on the simulated board: what it keeps, what it says, and that its recording shows the same views."""

import io
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from rich.console import Console

from abs_service import cli
from abs_service.calibration.files import target_file
from abs_service.calibration.shots.collection import Collector
from abs_service.calibration.shots.corner_extraction import BoardObservations, see
from abs_service.calibration.shots.guide import LineGuide, coverage_map, draw
from abs_service.calibration.shots.shot_sources import RecordingShots
from abs_service.supervision.exit_codes import Exit
from calib.board.corners.errors import BlurredError, MovedError
from calib.board.distinct import counts_of, distinct_poses
from drivers.replay.recording import Recording
from drivers.simulated.shapes.printed import TARGETS
from tests.calib.board.test_coverage import SIZES, many, view

RIG = """
version = 1
name = "bench"
[devices.sim]
uri = "simulated://target?sensors=tof,color&rate=20&hold=2&seed=4&color=640x480"
[sensors.depth_camera]
device = "sim"
head = "tof"
[sensors.color]
device = "sim"
"""


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    target_file.write(TARGETS["chessboard"], tmp_path / "target.toml")
    out = tmp_path / "board.mcap"
    return [str(tmp_path / "rig.toml"), "--target", str(tmp_path / "target.toml"), "--out", str(out)]


@pytest.mark.slow
def test_a_capture_that_ends_early_says_what_is_missing_and_can_be_read_again(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = cli.main(["calibrate", "capture", *files, "--limit-s", "8", "--json"])
    said = json.loads(capsys.readouterr().out)
    assert code == said["exit_code"] in (1, 2)
    assert said["shots"] >= 1
    assert {missing["sensor"] for missing in said["missing"]} == {"depth_camera", "color"}
    recording = Recording(tmp_path / "board.mcap")
    shots = RecordingShots(recording, every_s=0.5)
    seen = [see(TARGETS["chessboard"], shot, recording.cameras) for shot in shots]
    corners = [view for one in seen for view in one.corners]
    counts = counts_of(corners, distinct_poses(corners))
    assert all(1 <= said["poses"][name] <= counts[name] for name in said["poses"])
    assert {plane.sensor for one in seen for plane in one.planes} == {"depth_camera"}
    for name, size in (("depth_camera", (144, 176)), ("color", (480, 640))):
        picture = cv2.imread(str(tmp_path / f"board-{name}.png"))
        assert picture is not None
        assert picture.shape[:2] == size


def test_a_recording_that_exists_is_not_overwritten(files: list[str], tmp_path: Path, capsys) -> None:
    (tmp_path / "board.mcap").write_bytes(b"dear")
    assert cli.main(["calibrate", "capture", *files]) == Exit.USER
    assert "board.mcap: exists already" in capsys.readouterr().err
    assert (tmp_path / "board.mcap").read_bytes() == b"dear"


def test_without_a_view_nothing_is_written_and_the_command_can_be_given_again(
    files: list[str], tmp_path, capsys
) -> None:
    other = TARGETS["charuco"]
    target_file.write(other, tmp_path / "target.toml")
    before = {*tmp_path.iterdir()}
    for _ in range(2):
        assert cli.main(["calibrate", "capture", *files, "--limit-s", "1", "--json"]) == Exit.USER
        said = json.loads(capsys.readouterr().out)
        assert (said["shots"], said["recording"]) == (0, None)
        assert {*tmp_path.iterdir()} == before


def test_controls_of_the_rig_file_are_set_as_for_tracking(files: list[str], tmp_path: Path, capsys) -> None:
    """A value that the device does not take is rejected, by the name of its table."""
    with (tmp_path / "rig.toml").open("a", encoding="utf-8") as file:
        file.write("[devices.sim.controls]\nexposure_s = 1.0\n")
    assert cli.main(["calibrate", "capture", *files]) == Exit.USER
    assert "rig.toml: devices.sim.controls.exposure_s" in capsys.readouterr().err
    assert not (tmp_path / "board.mcap").exists()


def collected() -> Collector:
    collector = Collector(SIZES)
    for one in many():
        collector.take(BoardObservations(corners=(one,), sizes=SIZES))
    return collector


def test_a_collection_ends_when_nothing_is_missing() -> None:
    collector = collected()
    assert (collector.kept, list(collector.missing_views), collector.problem()) == (13, [], "")


def test_what_adds_nothing_and_what_moves_is_not_kept() -> None:
    collector = Collector({**SIZES, "tof": (176, 144)})
    assert collector.take(BoardObservations(corners=(view(),)))
    assert not collector.take(BoardObservations(corners=(view((0.01, 0.0, 0.0)),)))
    assert collector.latest == {"color": "nothing new: change the pose"}
    moved = {(2, "tof"): MovedError("the board moved")}
    assert not collector.take(BoardObservations(corners=(view((0.5, 0, 0)),), rejected=moved))
    assert collector.latest["tof"] == "the board moved"
    assert collector.problem().startswith("color: 1 view of 1 distinct pose of the board")


def test_people_see_maps_wishes_and_reasons() -> None:
    collector = Collector(SIZES)
    collector.take(BoardObservations(corners=(view(),)))
    collector.take(BoardObservations(rejected={(1, "color"): BlurredError("the image is blurred")}))
    console = Console(width=90, record=True, file=io.StringIO())
    console.print(draw(collector))
    text = console.export_text()
    assert "color" in text
    assert "▓" in text
    assert "the image is blurred" in text
    assert "tilt the board more: let it face left" in text


def test_lines_are_said_once(capsys: pytest.CaptureFixture[str]) -> None:
    collector = Collector(SIZES)
    guide = LineGuide(Console())
    blurred = BoardObservations(rejected={(1, "color"): BlurredError("the image is blurred")})
    for seen in (blurred, blurred, BoardObservations(corners=(view(),))):
        guide.update(collector, collector.take(seen))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "color: the image is blurred"
    assert lines[1].startswith("kept 1. Next: tilt the board more")
    assert len(lines) == 2


def test_the_map_is_red_where_nobody_has_seen_the_board() -> None:
    picture = coverage_map(np.zeros((480, 640), np.uint8), [view(distance=2.0)])
    assert picture[10, 10].argmax() == 2
    assert picture[240, 320].max() == 0
    u, v = np.rint(view(distance=2.0).pixels[0]).astype(int)
    assert picture[v, u].argmax() == 1
