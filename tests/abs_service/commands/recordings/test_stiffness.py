"""`abs-service stiffness`: one number with its deviation and a picture, or clear words."""

import io
import json
import re
from contextlib import redirect_stdout
from pathlib import Path

import cv2
import numpy as np
import pytest

from abs_service import cli
from abs_service.supervision.exit_codes import Exit
from drivers.simulated.address import parse
from tests.abs_service.commands.recordings.simulated_recording import write_take

ROOT = Path(__file__).parents[4]
TOML = (ROOT / "examples" / "rigs" / "gravity.toml").read_text(encoding="utf-8")
HEADS = {"tof": "tof", "color": "color"}


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    simulation = parse("simulated://strip?seed=3&stiffness=0.02&weight=0.3").build()
    return write_take(tmp_path_factory.mktemp("strips") / "strip.mcap", simulation, range(60), HEADS, TOML)


@pytest.fixture(scope="module")
def said(recording) -> dict:
    """Output of the command as JSON; it has also drawn profile.png beside the recording."""
    plot = recording.with_name("profile.png")
    with redirect_stdout(io.StringIO()) as output:
        assert cli.main(["stiffness", str(recording), "--weight", "0.3", "--plot", str(plot), "--json"]) == Exit.OK
    return json.loads(output.getvalue())


def test_the_stiffness_and_a_picture_come_out(recording, said):
    assert said["frames"] + said["frames_untracked"] == 60
    error = np.log(said["bending_stiffness_per_width_nm"] / 0.02)
    assert abs(error) < 4 * said["relative_deviation"] < 0.6
    assert said["bending_stiffness_nm2"] == pytest.approx(said["bending_stiffness_per_width_nm"] * said["width_m"])
    picture = cv2.imread(str(recording.with_name("profile.png")))
    assert picture is not None
    assert np.ptp(picture) > 100


@pytest.mark.usefixtures("said")  # when no kernel has to be compiled any more, images are all that is counted
def test_the_text_has_stiffness_and_uncertainty(recording, capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # a terminal, for rich
    assert cli.main(["stiffness", str(recording), "--weight", "0.3"]) == Exit.OK
    said, progress = capsys.readouterr()
    assert re.search(r"images .*?(\d+)/\1\D", progress)
    assert "bending stiffness per width  D = " in said
    assert "mN·m ± " in said
    assert "strip-stiffness.png" in said
    assert recording.with_name("strip-stiffness.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (["--weight", "0.3", "--tracker", "sheet"], "--tracker sheet: must be a tracker with a gravity model, one of"),
        (["--weight", "0.3", "--plot", "no/folder/x.png"], "--plot no/folder/x.png: there is no folder no/folder"),
        (
            ["--weight", "0.3", "--config", str(ROOT / "examples" / "rigs" / "flexpad.toml")],
            "no tracker has a gravity model",
        ),
    ],
)
def test_impossible_options_are_reported(recording, capsys, options, problem):
    assert cli.main(["stiffness", str(recording), *options]) == Exit.USER
    assert problem in capsys.readouterr().err


def test_a_weight_is_above_0(capsys):
    with pytest.raises(SystemExit, match="2"):
        cli.main(["stiffness", "x.mcap", "--weight", "-1"])
    assert "argument --weight: '-1' must be a number above 0" in capsys.readouterr().err


def test_a_plot_has_a_known_format(capsys):
    with pytest.raises(SystemExit, match="2"):
        cli.main(["stiffness", "x.mcap", "--weight", "0.3", "--plot", "x.doc"])
    assert "argument --plot: x.doc: its suffix must be one of .png, .svg, .pdf" in capsys.readouterr().err


def test_too_short_a_recording_is_refused(tmp_path, capsys):
    simulation = parse("simulated://strip?seed=3&stiffness=0.02&weight=0.3").build()
    short = write_take(tmp_path / "short.mcap", simulation, range(8), HEADS, TOML)
    assert cli.main(["stiffness", str(short), "--weight", "0.3"]) == Exit.USER
    assert "frames with a tracked strip are too few" in capsys.readouterr().err
