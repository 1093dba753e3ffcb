"""A hand crosses the sheet and hides a quarter of it: the error of what remains visible, and of what it hides.

  python -m evaluation.method.occlusion [--seeds 1 2 3] [--frames 240]

The same frames with and without the hand. Which vertices are hidden from the time-of-flight head is the simulator's
knowledge, not the tracker's.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.simulation import Simulation
from evaluation.sequences import expose, track
from tests.tracker.driving import default_plan, rig_of, simulate

#: Frames in which less of the sheet is hidden do not count as occluded.
LEAST_SHARE = 0.05


@dataclass(frozen=True)
class Occlusion:
    """What a passing hand does to one sequence.

    Attributes:
        share: largest part of the vertices that it hides.
        plain_mm: mean vertex error without the hand in the frames in which it would hide something [mm].
        visible_mm: with the hand, of the vertices that stay visible [mm].
        hidden_mm: with the hand, of those that it hides [mm].
    """

    share: float
    plain_mm: float
    visible_mm: float
    hidden_mm: float


def occlusion(seed: int, frames: int) -> Occlusion:
    """Tracks the demo rig's sheet with and without the hand."""
    plain = errors(simulate(f"simulated://sheet?seed={seed}"), frames)[0]
    error, hidden = errors(simulate(f"simulated://sheet?seed={seed}&occluder=hand"), frames)
    crossed = hidden.mean(axis=1) > LEAST_SHARE
    return Occlusion(
        share=float(hidden.mean(axis=1).max()),
        plain_mm=float(plain[crossed].mean()),
        visible_mm=float(error[crossed][~hidden[crossed]].mean()),
        hidden_mm=float(error[crossed][hidden[crossed]].mean()),
    )


def errors(simulation: Simulation, frames: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Error of every vertex [mm] and whether it is hidden from the time-of-flight head, each (frames, n)."""
    followed = track(rig_of(simulation), default_plan(), expose(simulation, range(frames)))
    eye = simulation.heads["tof"].camera.center
    distances, hidden = [], []
    for k, (estimate, points) in enumerate(zip(followed.estimates, followed.material)):
        distances.append(np.linalg.norm(estimate.vertices - points, axis=1) * 1e3)
        moment = simulation.scene.at(simulation.time_ns(k) * 1e-9)
        # A hair's breadth before the sheet, which else would hide its own points.
        before = points + (eye - points) * (1e-3 / np.linalg.norm(eye - points, axis=1, keepdims=True))
        hidden.append(moment.hidden(before[None], eye)[0])
    return np.array(distances), np.array(hidden)


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--frames", type=int, default=240)
    arguments = parser.parse_args()
    print("| seed | hidden at most | without the hand mm | visible vertices mm | ratio | hidden vertices mm |")
    print("|---|---|---|---|---|---|")
    for seed in arguments.seeds:
        found = occlusion(seed, arguments.frames)
        print(
            f"| {seed} | {found.share:.0%} | {found.plain_mm:.2f} | {found.visible_mm:.2f} | "
            f"{found.visible_mm / found.plain_mm:.2f} | {found.hidden_mm:.2f} |"
        )


if __name__ == "__main__":
    main()
