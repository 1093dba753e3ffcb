"""E10: the bending stiffness of a simulated strip, recovered from how it hangs while a gripper moves it.

  python -m tests.evaluation.stiffness [--seeds 1 2 3 4] [--frames 240]

The simulator integrates the heavy elastica by itself. The weight is given; length and gripper are found in the first
frame.
"""

import argparse
from dataclasses import dataclass

import numpy as np

from abs_service.tracker.models import gravity
from abs_service.tracker.stiffness import Stiffness, estimate_stiffness, hanging
from abs_service.tracking import Tracking
from tests.tracker.driving import default_plan, drive, mean_errors, rig_of, simulate

#: Bending stiffness per width [N·m]: the strip sags by 80° to 5°.
STIFFNESSES = (0.005, 0.01, 0.02, 0.04, 0.08)

#: Weight per area of the simulated strip [N/m²]: 0.3 kg/m².
WEIGHT = 0.3 * 9.81


@dataclass(frozen=True)
class Trial:
    """One sequence.

    Attributes:
        true, found: bending stiffness per width [N·m].
        stiffness: what was estimated.
        surface_mm: mean surface error of the tracked strip [mm].
    """

    true: float
    found: float
    stiffness: Stiffness
    surface_mm: float

    @property
    def error(self) -> float:
        """Of the stiffness' logarithm, in its own standard deviations."""
        return float(np.log(self.found / self.true) / self.stiffness.deviation)


def trial(true: float, seed: int, frames: int) -> Trial:
    """Tracks a strip and estimates its stiffness."""
    simulation = simulate(f"simulated://strip?seed={seed}&sensors=tof,color&stiffness={true}")
    tracking = Tracking(rig_of(simulation), default_plan(model=gravity.Settings(), vertices=200))
    steps = list(drive(tracking, simulation, range(frames)))
    model = tracking.model
    if not isinstance(model, gravity.Gravity):
        raise TypeError(f"a gravity model was asked for, not {model}")
    hangings = [hanging(model, step.estimate.theta, step.estimate.covariance) for step in steps]
    found = estimate_stiffness(hangings, model.strip.length, model.strip.length_deviation)
    return Trial(true, found.bending(WEIGHT, model.strip.length), found, mean_errors(steps)[1])


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4])
    parser.add_argument("--frames", type=int, default=240)
    arguments = parser.parse_args()
    print("| true D mN·m | found (seeds) | stated deviation | errors in deviations | surface error mm |")
    print("|---|---|---|---|---|")
    errors = []
    for true in STIFFNESSES:
        trials = [trial(true, seed, arguments.frames) for seed in arguments.seeds]
        errors += [one.error for one in trials]
        found = ", ".join(f"{one.found * 1e3:.2f}" for one in trials)
        stated = ", ".join(f"{one.stiffness.deviation:.1%}" for one in trials)
        each = ", ".join(f"{one.error:+.1f}" for one in trials)
        surface = np.mean([one.surface_mm for one in trials])
        print(f"| {true * 1e3:g} | {found} | {stated} | {each} | {surface:.2f} |", flush=True)
    inside, spread = np.mean(np.abs(errors) < 1.96), np.sqrt(np.mean(np.square(errors)))
    print(f"\n{inside:.0%} of {len(errors)} within 1.96 stated deviations; root mean square {spread:.2f}")


if __name__ == "__main__":
    main()
