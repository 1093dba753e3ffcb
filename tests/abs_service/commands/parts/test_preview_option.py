"""--picture of `replay` and `check`: what would be tracked in one look, or clear words."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from abs_service import cli, config
from abs_service.commands.parts.checks import harmless_devices
from abs_service.display.pictures import preview_picture
from abs_service.display.pictures.preview_picture import (
    BELOW,
    CLASS_COLORS,
    LEFT,
    LEGEND,
    LINE,
    NO_RETURN,
    REGION,
    WARNING,
)
from abs_service.supervision.exit_codes import Exit
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.terms.depth.outline.rim_classes import RimClass
from abs_service.tracking.preview import FoundMesh, Preview
from calib.camera import Camera
from drivers.simulated.address import parse
from tests.abs_service.commands import test_check
from tests.abs_service.commands.recordings.simulated_recording import write_take
from tests.abs_service.tracker.scenes import flat, sheet

ROOT = Path(__file__).parents[4]
HEADS = {"tof": "tof", "color": "color"}
RIG = test_check.RIG.replace("sensors=tof", "sensors=tof&tof=160x120")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    simulation = parse("simulated://sheet?seed=1&tof=160x120").build()
    path = tmp_path_factory.mktemp("recordings") / "x.mcap"
    return write_take(path, simulation, range(30, 32), HEADS, config.to_toml(config.load_default()))


def drawn(picture: Path) -> np.ndarray:
    """Red, green, blue (height, width, 3) of a picture."""
    image = cv2.imread(str(picture), cv2.IMREAD_COLOR_RGB)
    assert image is not None
    return image


def count(image: np.ndarray, color: str) -> int:
    """Number of pixels of exactly this colour "#rrggbb"."""
    return int((image == np.frombuffer(bytes.fromhex(color[1:]), np.uint8)).all(axis=2).sum())


def has(picture: Path, color: str) -> bool:
    """True if the depth image of a picture, without the legend, has pixels of a colour."""
    return count(drawn(picture)[LINE:-BELOW, LEFT:-LEGEND], color) > 0


def size(picture: Path) -> tuple[int, int]:
    height, width = drawn(picture).shape[:2]
    return width, height


def test_replay_draws_what_it_tracks_then(recording, tmp_path, capsys):
    picture, out = tmp_path / "first.png", tmp_path / "out.mcap"
    options = ["--picture", str(picture), "--out", str(out), "--json"]
    assert cli.main(["replay", str(recording), *options]) == Exit.OK
    captured = capsys.readouterr()
    assert [json.loads(line)["status"] for line in captured.out.splitlines()] == ["TRACKING"] * 2
    line = next(line for line in captured.err.splitlines() if line.startswith(f"wrote {picture}; sheet has "))
    derived = json.loads(captured.out.splitlines()[0])["derived"]
    assert f"mesh.vertices = {derived['mesh.vertices'][0]:.0f}, model.control_points = [" in line
    assert line.endswith("model.degree = 3, objective.outline_px = 0.5")
    assert out.exists()
    assert size(picture) == (LEFT + 6 * 160 + LEGEND, LINE + 6 * 120 + BELOW)
    for color in (CLASS_COLORS[RimClass.FREE], REGION, NO_RETURN):
        assert has(picture, color)


@pytest.mark.parametrize("wanted", [(160, 120), (640, 480)])
def test_every_class_has_its_colour_at_every_size(tmp_path, wanted):
    width, height = wanted
    camera = Camera(width, height, 1.5 * width, 1.5 * width, width / 2, height / 2)
    mesh: Mesh = sheet(9, 13, flat)
    rim = np.arange(5)
    found = FoundMesh(mesh, mesh.vertices, rim, rim.astype(np.uint8))
    distance = np.full((height, width), 1.0, np.float32)
    distance[:10] = np.nan
    seen = Preview(0, camera, distance, distance > 0, found, "")
    preview_picture.draw(seen, "sheet", "nurbs", tmp_path / "x.png")
    enlarged = {160: 6, 640: 2}[width]
    assert size(tmp_path / "x.png") == (LEFT + enlarged * width + LEGEND, LINE + enlarged * height + BELOW)
    for color in (*CLASS_COLORS.values(), REGION, NO_RETURN):
        assert has(tmp_path / "x.png", color)
    image = drawn(tmp_path / "x.png")
    assert np.count_nonzero(image[LINE:-BELOW, LEFT:-LEGEND].min(axis=2) > 150) > 1000  # the mesh, on dark grey
    assert (image[-BELOW + 12 :, LEFT:-LEGEND].max(axis=2) > 150).any()  # the columns' numbers
    assert (image[LINE:-BELOW, : LEFT - 12].max(axis=2) > 150).any()  # the rows'
    assert count(image, WARNING) == 0
    title = preview_picture.title(seen, "sheet", "nurbs")
    assert title == "sheet (nurbs), frame 0: 117 vertices, 300 × 200 × 0 mm, 1.00 m away"


def test_doubts_are_sentences_of_their_own():
    distance = np.ones((4, 4), np.float32)
    camera = Camera(4, 4, 4.0, 4.0, 1.5, 1.5)
    mesh = sheet(3, 3, flat)
    found = FoundMesh(mesh, mesh.vertices, np.zeros(0, np.intp), np.zeros(0, np.uint8))
    seen = Preview(
        7, camera, distance, distance > 0, found, "nothing is near", ("it is large: is it right?", "it slants")
    )
    assert preview_picture.note(seen) == (
        "It is large: is it right? It slants. Not found in the first frame: nothing is near."
    )


def test_check_draws_what_a_simulated_device_shows(tmp_path, capsys):
    (tmp_path / "rig.toml").write_text(RIG)
    picture = tmp_path / "first.png"
    assert cli.main(["check", str(tmp_path / "rig.toml"), "--picture", str(picture)]) == Exit.OK
    assert f"wrote {picture}; sheet has mesh.vertices = " in capsys.readouterr().out
    assert has(picture, REGION)


def test_check_draws_what_a_recording_shows_for_every_tracker(recording, tmp_path, capsys):
    text = config.to_toml(config.load_default())
    table = text[text.index("[trackers.sheet]") :].partition("[record]")[0].replace("trackers.sheet", "trackers.other")
    uri = f"replay://{recording}"
    rig = tmp_path / "rig.toml"
    rig.write_text(text.replace(config.load_default().devices["sim"].uri, uri) + table)
    assert cli.main(["check", str(rig), "--picture", str(tmp_path / "a.png"), "--json"]) == Exit.OK
    captured = capsys.readouterr()
    assert json.loads(captured.out)["ok"]
    assert "a-other.png" in captured.err
    assert has(tmp_path / "a-sheet.png", REGION)
    assert not (tmp_path / "a.png").exists()
    assert has(tmp_path / "a-other.png", REGION)


def test_what_is_not_found_is_said_in_words_and_in_the_picture(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(harmless_devices, "TAKEN_S", 0.1)
    text = RIG + 'region = { type = "box", lowest = [5.0, 5.0, 5.0], highest = [6.0, 6.0, 6.0] }\n'
    (tmp_path / "rig.toml").write_text(text)
    picture = tmp_path / "first.png"
    assert cli.main(["check", str(tmp_path / "rig.toml"), "--picture", str(picture)]) == Exit.OK
    assert "note: sheet finds nothing to track: the box" in capsys.readouterr().err
    assert count(drawn(picture), WARNING) > 20  # what is neither background nor smoothed
    assert has(picture, NO_RETURN)
    assert not has(picture, REGION)


def test_doubts_about_the_object_are_said_before_it_is_tracked(tmp_path, capsys):
    text = RIG + 'region = { type = "box", lowest = [-9.0, -9.0, 0.0], highest = [9.0, 9.0, 9.0] }\n'
    (tmp_path / "rig.toml").write_text(text)
    picture = tmp_path / "first.png"
    assert cli.main(["check", str(tmp_path / "rig.toml"), "--picture", str(picture)]) == Exit.OK
    assert "note: sheet: the object fills " in capsys.readouterr().err
    assert count(drawn(picture), WARNING) > 20


@pytest.mark.parametrize("command", ["replay", "check"])
def test_a_picture_has_a_known_format(capsys, command):
    with pytest.raises(SystemExit, match="2"):
        cli.main([command, "x", "--picture", "x.jpg"])
    assert "argument --picture: x.jpg: its suffix must be one of .png, .svg, .pdf" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["replay", "check"])
def test_a_path_that_cannot_be_written_is_refused(recording, tmp_path, capsys, command):
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG)
    picture = tmp_path / "no" / "folder" / "x.png"
    assert cli.main([command, str(recording if command == "replay" else rig), "--picture", str(picture)]) == Exit.USER
    assert f"error: --picture {picture}: there is no folder {picture.parent}\n" in capsys.readouterr().err
    assert not list(recording.parent.glob("*_replay*"))


def test_check_opens_no_device_that_may_be_real(tmp_path, capsys):
    asked = ["check", str(ROOT / "examples" / "rigs" / "kinect.toml"), "--picture", str(tmp_path / "x.png")]
    assert cli.main(asked) == Exit.USER
    assert "devices.kinect is kinect1://, and only replay and simulated devices are opened" in capsys.readouterr().err
    assert not (tmp_path / "x.png").exists()


def test_a_device_that_ends_has_no_more_frames(recording, tmp_path, capsys):
    """A recording without the object ends before `TAKEN_S` is over."""
    text = RIG.replace("simulated://sheet?seed=1&sensors=tof&tof=160x120", f"replay://{recording}?speed=100")
    text += 'region = { type = "box", lowest = [5.0, 5.0, 5.0], highest = [6.0, 6.0, 6.0] }\n'
    (tmp_path / "rig.toml").write_text(text)
    assert cli.main(["check", str(tmp_path / "rig.toml"), "--picture", str(tmp_path / "x.png")]) == Exit.OK
    assert "finds nothing to track" in capsys.readouterr().err
