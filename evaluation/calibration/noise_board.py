"""Noise calibration of a simulated time-of-flight head with a static board.

The same as `abs-service calibrate noise --target`. The head has an offset of 12 mm, a bias on dark surfaces, and
wiggling.

Statistic: 99th percentile over the board's pixels of the error of σ and of μ, the largest of the seeds.
Goals: 10 % and 1 mm.
Seeds: 3, 4 and 5; the context's is not used.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.noise import board_poses, measurement
from abs_service.calibration.shots import sequences
from abs_service.report.content import Cell, Column, Section, Table
from calib.noise.base import pixels_where
from calib.sequences.static_board import StaticBoard
from drivers.simulated.sensors.time_of_flight import TimeOfFlight
from drivers.simulated.simulation import Simulation
from evaluation.calibration.simulated_board import Scene, scene
from evaluation.experiment import Context, Findings, at_most

ERRORS = ("offset=0.012", "dark=-8", "wiggle=0.002")
RATE = 10
#: Each pose is held for two seconds, and takes one to change.
PERIOD_S = 3


def scene_of(sensors: str, *more: str) -> tuple[Scene, Simulation]:
    """A board that is held in one pose after another, and its simulation."""
    one = scene("chessboard", f"sensors={sensors}", f"rate={RATE}", f"hold={PERIOD_S - 1}", *more)
    return one, one.simulation


def static_sequence(simulation: Simulation, number: int, n: int) -> sequences.Sequence:
    """Static sequence of the depth sensor with the board in one of its poses."""
    taken = [frame for k in range(n) for frame in simulation.frames(number * PERIOD_S * RATE + k)]
    cameras = {name: head.camera for name, head in simulation.heads.items()}
    sensor = next(name for name in ("tof", "structured_light") if name in cameras)
    (found,) = sequences.of_frames(f"pose {number}", taken, cameras, sensor, n)
    return found


def true_distances(
    one: Scene, simulation: Simulation, number: int, sequence: sequences.Sequence
) -> NDArray[np.float64]:
    """True distances (height, width) [m] of the board's plane along the sensor's rays."""
    T_sb = sequence.camera.T_sr @ one.true_pose(simulation, number * PERIOD_S)
    return (T_sb[:3, 2] @ T_sb[:3, 3]) / (sequence.camera.rays() @ T_sb[:3, 2])


def calibrate(
    one: Scene, simulation: Simulation, poses: int, n: int
) -> tuple[measurement.NoiseCalibration, list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Calibrates a time-of-flight head; by pose, errors of μ [m] and relative errors of σ of the board's pixels."""
    found = [static_sequence(simulation, number, n) for number in range(poses)]
    boards: list[float | StaticBoard] = [board_poses.static_board(one.target, sequence) for sequence in found]
    everywhere = np.ones(found[0].lengths.shape[1:], bool)
    result = measurement.calibrate(found, boards, everywhere, np.random.default_rng(0), lambda text: None)
    head = simulation.heads["tof"]
    if not isinstance(head, TimeOfFlight):
        raise TypeError(f"tof is no time-of-flight head but {head}")
    mu, sigma = [], []
    for number, (sequence, static, by_board) in enumerate(zip(found, result.statics, result.references)):
        pixels = np.isfinite(by_board.distance)
        x, a = true_distances(one, simulation, number, sequence)[pixels], static.brightness[pixels]
        mu.append(result.model.mean(x, a, pixels_where(pixels)) - head.noise.mu(x, a))
        sigma.append(result.model.deviation(x, a, pixels_where(pixels)) / head.noise.sigma(x, a) - 1)
    return result, mu, sigma


TITLE = "Noise calibration with a board"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        seeds: of the simulated boards.
        poses: of the board.
        frames: of each pose.
    """

    seeds: tuple[int, ...] = (3, 4, 5)
    poses: int = 8
    frames: int = 10


QUICK = Settings((4,), 8, 8)

_COLUMNS = (
    Column("seed"), Column("model"), Column("uncertainty of the board", "mm"), Column("error of μ, 99 %", "mm", ".2f"),
    Column("error of μ, worst pose", "mm", ".2f"), Column("error of σ, 99 %", "%", ".1f"),
)  # fmt: skip


def run(settings: Settings, context: Context) -> Findings:
    """Calibrates with every seed's board."""
    rows: list[tuple[Cell, ...]] = []
    found = {}
    for seed in settings.seeds:
        context.progress(f"seed {seed}")
        result, mu, sigma = calibrate(*scene_of("tof", f"seed={seed}", *ERRORS), settings.poses, settings.frames)
        known = [1e3 * board.uncertainty for board in result.boards]
        worst_mm = 1e3 * max(abs(float(np.median(each))) for each in mu)
        mu_mm, share = (float(np.quantile(np.abs(np.concatenate(each)), 0.99)) for each in (mu, sigma))
        found[seed] = {"mu_mm": 1e3 * mu_mm, "worst_pose_mm": worst_mm, "sigma_percent": 100 * share}
        span = f"{min(known):.2f} to {max(known):.2f}"
        rows.append((seed, result.chosen.candidate.name, span, *found[seed].values()))
    goals = (
        at_most("Error of σ in 99 % of the pixels", max(one["sigma_percent"] for one in found.values()), 10, "%"),
        at_most("Error of μ in 99 % of the pixels", max(one["mu_mm"] for one in found.values()), 1, "mm"),
    )
    table = Table("Errors on the board", _COLUMNS, tuple(rows))
    return Findings(goals, (Section("Errors", (table,)),), {str(seed): one for seed, one in found.items()})
