"""`abs-service calibrate noise --target`: the board tells its own distance, and so what a sensor errs by."""

import json
from pathlib import Path

import numpy as np
import pytest

from abs_service.calibration import noise, placing, sequences, target_file
from abs_service.cli import main
from abs_service.exits import Exit
from calib.board.target import Chessboard
from calib.noise.base import pixels_where
from calib.sequences import reference
from calib.sequences.placed import Placed
from calib.sequences.reference import Kind
from calib.sequences.static import reduce
from drivers.simulated.simulation import Simulation
from drivers.simulated.time_of_flight import TimeOfFlight
from tests.calibration.simulated import Filmed, Scene, record, scene

ERRORS = ("offset=0.012", "dark=-8", "wiggle=0.002")
RATE = 10
#: Each pose is held for two seconds, and takes one to change.
PERIOD = 3


def at_rest(simulation: Simulation, number: int, n: int) -> sequences.Sequence:
    """A sequence in one of the poses that the board is held in."""
    taken = [frame for k in range(n) for frame in simulation.frames(number * PERIOD * RATE + k)]
    cameras = {name: head.camera for name, head in simulation.heads.items()}
    sensor = next(name for name in ("tof", "structured_light") if name in cameras)
    (found,) = sequences.of_frames(f"pose {number}", taken, cameras, sensor, n)
    return found


def filmed(sensors: str, *more: str) -> tuple[Scene, Simulation]:
    one = scene("chessboard", f"sensors={sensors}", f"rate={RATE}", "hold=2", "seed=3", *more)
    return one, one.simulation


def true_distances(one: Scene, simulation: Simulation, number: int, sequence: sequences.Sequence) -> np.ndarray:
    """Where the sensor's rays pierce the plane in which the board truly lies [m]."""
    T_sb = sequence.camera.T_sr @ one.true_pose(simulation, number * PERIOD)
    return (T_sb[:3, 2] @ T_sb[:3, 3]) / (sequence.camera.rays() @ T_sb[:3, 2])


@pytest.mark.parametrize(
    ("sensors", "seer"), [("tof", "tof"), ("structured_light,color", "color")], ids=["amplitudes", "another sensor"]
)
def test_the_board_tells_real_distances_that_a_fitted_plane_cannot(sensors: str, seer: str) -> None:
    one, simulation = filmed(sensors, "color=640x480", *(ERRORS if sensors == "tof" else ()))
    sequence = at_rest(simulation, 0, 8)
    board = placing.placed(one.target, sequence)
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
    one, simulation = filmed("tof", *ERRORS)
    found = [at_rest(simulation, number, 10) for number in range(5)]
    boards: list[float | Placed] = [placing.placed(one.target, sequence) for sequence in found]
    everywhere = np.ones(found[0].lengths.shape[1:], bool)
    result = noise.calibrate(found, boards, everywhere, np.random.default_rng(0), lambda text: None)
    assert result.kind is Kind.BOARD
    head = simulation.heads["tof"]
    assert isinstance(head, TimeOfFlight)
    law = head.noise
    off, ratio = [], []
    for number, (sequence, static, by_board) in enumerate(zip(found, result.statics, result.references)):
        pixels = np.isfinite(by_board.distance)
        x, a = true_distances(one, simulation, number, sequence)[pixels], static.brightness[pixels]
        places = pixels_where(pixels)
        off.append(result.model.mean(x, a, places) - law.mu(x, a))
        ratio.append(result.model.deviation(x, a, places) / law.sigma(x, a))
        assert abs(np.median(off[-1])) < 1e-3
    assert np.quantile(np.abs(np.concatenate(off)), 0.95) < 2e-3
    assert np.median(np.concatenate(ratio)) == pytest.approx(1, abs=0.1)


@pytest.fixture
def board(tmp_path: Path) -> list[str]:
    target_file.write(scene("chessboard").target, tmp_path / "board.toml")
    return ["--target", str(tmp_path / "board.toml"), "--out", str(tmp_path / "noise")]


@pytest.mark.slow
def test_the_report_says_how_well_the_reference_is_known(tmp_path: Path, board: list[str], capsys) -> None:
    _, simulation = filmed("structured_light,color", "color=640x480", "structured_light=160x120")
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
    assert "Where the board was" in page
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


def test_a_board_that_moves_during_the_sequence_is_refused() -> None:
    simulation = filmed("tof")[1]
    taken = [frame for k in (*range(8), *range(30, 38)) for frame in simulation.frames(k)]
    cameras = {"tof": simulation.heads["tof"].camera}
    (sequence,) = sequences.of_frames("x", taken, cameras, "", 16)
    with pytest.raises(sequences.SequenceError):
        placing.placed(Chessboard(8, 5, 0.04), sequence)
