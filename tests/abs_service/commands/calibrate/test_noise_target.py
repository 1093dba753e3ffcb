"""`abs-service calibrate noise --target`: the board tells its own distance, and so what a sensor errs by."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from abs_service.calibration.files import target_file
from abs_service.calibration.noise import board_poses
from abs_service.calibration.shots import sequences
from abs_service.cli import main
from abs_service.supervision.exit_codes import Exit
from calib.board.target import Chessboard
from calib.sequences import reference
from calib.sequences.reference import Kind
from calib.sequences.static import reduce
from evaluation.calibration.noise_board import ERRORS, calibrate, scene_of, static_sequence, true_distances
from evaluation.calibration.simulated_board import Filmed, record, scene


@pytest.mark.parametrize(
    ("sensors", "seer"), [("tof", "tof"), ("structured_light,color", "color")], ids=["amplitudes", "another sensor"]
)
def test_the_board_tells_real_distances_that_a_fitted_plane_cannot(sensors: str, seer: str) -> None:
    one, simulation = scene_of(sensors, "seed=3", "color=640x480", *(ERRORS if sensors == "tof" else ()))
    sequence = static_sequence(simulation, 0, 8)
    board = board_poses.static_board(one.target, sequence)
    truth = true_distances(one, simulation, 0, sequence)
    assert board.seen_by == seer
    assert board.uncertainty < 5e-4
    static = reduce(
        "x", sequence.lengths, sequence.amplitude, sequence.camera.rays(), sequence.along, sequence.digit, 8
    )
    everywhere = np.ones(truth.shape, bool)
    by_board = reference.on_board(static, board, everywhere)
    by_plane = reference.fitted(static, board.inside, np.random.default_rng(0))
    assert np.isfinite(by_board.distance).sum() > 2000
    assert np.nanmax(np.abs(by_board.distance - truth)) < 5e-4
    if sensors == "tof":
        mu = np.nanmedian(static.mean - truth + 0 * by_board.distance)
        assert mu > 8e-3
        assert np.nanmedian(static.mean - by_board.distance) == pytest.approx(mu, abs=5e-4)
        assert abs(np.nanmedian(static.mean - by_plane.distance)) < 1e-3


@pytest.mark.slow
def test_five_poses_of_a_board_give_the_mean_offset() -> None:
    result, mu, sigma = calibrate(*scene_of("tof", "seed=3", *ERRORS), poses=5, n=10)
    assert result.kind is Kind.BOARD
    assert max(abs(np.median(each)) for each in mu) < 1e-3
    assert np.quantile(np.abs(np.concatenate(mu)), 0.99) < 2e-3
    assert np.quantile(np.abs(np.concatenate(sigma)), 0.99) < 0.1


@pytest.fixture
def board(tmp_path: Path) -> list[str]:
    target_file.write(scene("chessboard").target, tmp_path / "board.toml")
    return ["--target", str(tmp_path / "board.toml"), "--out", str(tmp_path / "noise")]


@pytest.mark.slow
def test_the_report_says_how_well_the_reference_is_known(tmp_path: Path, board: list[str], capsys) -> None:
    _, simulation = scene_of("structured_light,color", "seed=3", "color=640x480", "structured_light=160x120")
    recording = record(Filmed(simulation, 12), tmp_path / "board.mcap")
    code = main(["calibrate", "noise", str(recording), *board, "--json"])
    said = json.loads(capsys.readouterr().out)
    assert code == Exit.FAILED  # one distance only
    assert said["values"]["reference"] == "board pose"
    assert 0 < said["values"]["reference_deviation_m"] < 1e-3
    (text,) = (one["text"] for one in said["verdicts"] if one["text"].startswith("The reference is known to 0."))
    assert "in the images of color" in text
    assert not any("offset is not determined" in one["text"] for one in said["verdicts"])
    page = (tmp_path / "noise.html").read_text(encoding="utf-8")
    assert "Board poses from the mean images of the sequences" in page
    assert "--target" in page


def test_what_shows_no_board_is_said(tmp_path: Path, board: list[str], capsys) -> None:
    wall = "simulated://wall?sensors=tof&tof=32x24&rate=200"
    assert main(["calibrate", "noise", wall, "--frames", "9", *board]) == Exit.USER
    assert "tof: " in capsys.readouterr().err
    blind = "simulated://wall?sensors=structured_light&structured_light=32x24&rate=200"
    assert main(["calibrate", "noise", blind, "--frames", "9", *board]) == Exit.USER
    assert "no image of a sensor with a known camera" in capsys.readouterr().err
    assert main(["calibrate", "noise", wall, "--distance-m", "1", *board]) == Exit.USER
    assert "give only one of them" in capsys.readouterr().err


def test_cameras_of_a_calibration_take_the_place_of_the_source_s_own() -> None:
    one, simulation = scene_of("tof", "seed=3")
    sequence = static_sequence(simulation, 0, 6)
    longer = replace(sequence.camera, fx=1.01 * sequence.camera.fx, fy=1.01 * sequence.camera.fy)
    calibrated = sequences.with_cameras(sequence, {"tof": longer, "color": longer})
    assert set(calibrated.cameras) == {"tof"}
    near, far = (board_poses.static_board(one.target, taken) for taken in (sequence, calibrated))
    assert np.linalg.norm(near.plane) / np.linalg.norm(far.plane) == pytest.approx(1.01, abs=1e-3)
    with pytest.raises(sequences.SequenceError, match="176 × 144 pixels, but was calibrated with 100 × 144"):
        sequences.with_cameras(sequence, {"tof": replace(longer, width=100)})


def test_a_board_that_moves_during_the_sequence_is_refused() -> None:
    simulation = scene_of("tof", "seed=3")[1]
    taken = [frame for k in (*range(8), *range(30, 38)) for frame in simulation.frames(k)]
    cameras = {"tof": simulation.heads["tof"].camera}
    (sequence,) = sequences.of_frames("x", taken, cameras, "", 16)
    with pytest.raises(sequences.SequenceError):
        board_poses.static_board(Chessboard(8, 5, 0.04), sequence)
