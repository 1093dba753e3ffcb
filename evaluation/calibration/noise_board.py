"""What `abs-service calibrate noise --target` finds of a simulated time-of-flight head that shows a board at rest.

  python -m evaluation.calibration.noise_board

Eight poses of 10 frames each; the head errs by an offset of 12 mm, dark surfaces and wiggling.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.noise import board_poses, measurement
from abs_service.calibration.shots import sequences
from calib.noise.base import pixels_where
from calib.sequences.placed import Placed
from drivers.simulated.sensors.time_of_flight import TimeOfFlight
from drivers.simulated.simulation import Simulation
from tests.calibration.simulated import Scene, scene

ERRORS = ("offset=0.012", "dark=-8", "wiggle=0.002")
RATE = 10
#: Each pose is held for two seconds, and takes one to change.
PERIOD_S = 3
#: What the table is of.
SEEDS, POSES, FRAMES = (3, 4, 5), 8, 10


def filmed(sensors: str, *more: str) -> tuple[Scene, Simulation]:
    """A board that is held in one pose after another."""
    one = scene("chessboard", f"sensors={sensors}", f"rate={RATE}", f"hold={PERIOD_S - 1}", *more)
    return one, one.simulation


def at_rest(simulation: Simulation, number: int, n: int) -> sequences.Sequence:
    """A sequence of its depth sensor in one of these poses."""
    taken = [frame for k in range(n) for frame in simulation.frames(number * PERIOD_S * RATE + k)]
    cameras = {name: head.camera for name, head in simulation.heads.items()}
    sensor = next(name for name in ("tof", "structured_light") if name in cameras)
    (found,) = sequences.of_frames(f"pose {number}", taken, cameras, sensor, n)
    return found


def true_distances(
    one: Scene, simulation: Simulation, number: int, sequence: sequences.Sequence
) -> NDArray[np.float64]:
    """Where the sensor's rays pierce the plane in which the board truly lies (height, width) [m]."""
    T_sb = sequence.camera.T_sr @ one.true_pose(simulation, number * PERIOD_S)
    return (T_sb[:3, 2] @ T_sb[:3, 3]) / (sequence.camera.rays() @ T_sb[:3, 2])


def learnt(
    one: Scene, simulation: Simulation, poses: int, n: int
) -> tuple[measurement.Found, list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """What is learnt of a time-of-flight head; by pose, errors of μ [m] and of σ (as a share) of the board's pixels."""
    found = [at_rest(simulation, number, n) for number in range(poses)]
    boards: list[float | Placed] = [board_poses.placed(one.target, sequence) for sequence in found]
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


def main() -> None:
    """Prints the table."""
    print("| seed | model | known to, mm | μ, 99 %, mm | μ, worst pose, mm | σ, 99 %, % |")
    print("|---|---|---|---|---|---|")
    for seed in SEEDS:
        result, mu, sigma = learnt(*filmed("tof", f"seed={seed}", *ERRORS), POSES, FRAMES)
        known = [1e3 * board.uncertainty for board in result.boards]
        worst = 1e3 * max(abs(float(np.median(each))) for each in mu)
        most, wrong = (float(np.quantile(np.abs(np.concatenate(each)), 0.99)) for each in (mu, sigma))
        print(
            f"| {seed} | {result.chosen.candidate.name} | {min(known):.2f} to {max(known):.2f} | {1e3 * most:.2f} "
            f"| {worst:.2f} | {100 * wrong:.1f} |"
        )


if __name__ == "__main__":
    main()
