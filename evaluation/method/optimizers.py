"""What each optimiser makes of the demo rig, and what it costs: error, time and effort per frame.

  python -m evaluation.method.optimizers [--only hybrid cma_es] [--scenes demo fast hand turn]
                                        [--seeds 1 2 3] [--frames 180] [--budget-ms 24]

The scenes: the sheet as it moves in the demo; three times as fast; with a hand that crosses it; and one that turns by
90° within a quarter of a second, which no motion prior expects. Without `--budget-ms` the search does not look at the
clock. Times are CPU times of a whole frame on one core, without taking images in and without publishing; a BLAS with
threads of its own spoils them (OPENBLAS_NUM_THREADS=1).
"""

import argparse
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from abs_service.tracker.estimate import Estimate
from abs_service.tracker.optimizers import cma, cma_es, hybrid
from abs_service.tracking.session import OptimizerSettings, Tracking
from drivers.simulated.simulation import Simulation
from evaluation.sequences import TruthEvaluator
from tests.tracker.driving import Step, default_plan, frame_set, mean_errors, rig_of, simulate

SCENES: Mapping[str, str] = {"demo": "", "fast": "&speed=3", "hand": "&occluder=hand", "turn": "&turn=2"}
OPTIMIZERS: Mapping[str, OptimizerSettings] = {
    "hybrid": hybrid.Settings(),
    "cma_es": cma_es.Settings(),
    "cma": cma.Settings(),
}

COLUMNS = (
    "optimizer",
    "scene",
    "vertex (surface) error mm",
    "worst frame mm",
    "median ms",
    "95 % ms",
    "generations",
    "evaluations",
    "ended",
)


@dataclass(frozen=True)
class Run:
    """What one optimiser made of one sequence.

    Attributes:
        steps: estimates with their errors.
        times_ms: CPU time of each but the first frame [ms].
    """

    steps: Sequence[Step]
    times_ms: Sequence[float]


def track(simulation: Simulation, exposures: Sequence[int], settings: OptimizerSettings, budget_ms: float) -> Run:
    """Tracks exposures, each with a budget of real time."""
    tracking = Tracking(rig_of(simulation), default_plan(optimizer=settings))
    evaluator = TruthEvaluator(tracking)
    steps, times = [], []
    for k in exposures:
        frames, truth = simulation.expose(k)
        begin, begin_cpu = time.monotonic(), time.process_time()
        estimate = tracking.track(frame_set(frames, k), partial(_in_time, begin + budget_ms * 1e-3))
        times.append((time.process_time() - begin_cpu) * 1e3)
        steps.append(Step(estimate, evaluator.errors(estimate, truth.points_r)))
    return Run(steps, times[1:])


def _in_time(until_s: float) -> bool:
    return time.monotonic() < until_s


def row(runs: Sequence[Run]) -> str:
    """The cells of one optimiser and scene, over all seeds."""
    steps = [step for run in runs for step in run.steps]
    times = np.concatenate([run.times_ms for run in runs])
    vertex_mm, surface_mm = mean_errors(steps)
    worst_mm = max(step.errors.vertex_mm for step in steps if step.errors is not None)
    estimates = [step.estimate for run in runs for step in run.steps[1:]]
    evaluations = np.mean([estimate.evaluations for estimate in estimates])
    generations = np.mean([estimate.generations for estimate in estimates])
    return (
        f"{vertex_mm:.2f} ({surface_mm:.2f}) | {worst_mm:.1f} | {np.median(times):.1f} | "
        f"{np.quantile(times, 0.95):.1f} | {generations:.1f} | {evaluations:.0f} | {_stops(estimates)}"
    )


def _stops(estimates: Sequence[Estimate]) -> str:
    """Who found the estimates and why it stopped, the most frequent first."""
    found = Counter(f"{estimate.searcher} {estimate.stop}" for estimate in estimates)
    return ", ".join(f"{what} {count / len(estimates):.0%}" for what, count in found.most_common())


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=OPTIMIZERS, default=list(OPTIMIZERS))
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--frames", type=int, default=180)
    parser.add_argument("--budget-ms", type=float, default=float("inf"))
    arguments = parser.parse_args()
    print(f"| {' | '.join(COLUMNS)} |")
    print("|---" * len(COLUMNS) + "|")
    for scene in arguments.scenes:
        for name in arguments.only:
            sequences = [simulate(f"simulated://sheet?seed={seed}{SCENES[scene]}") for seed in arguments.seeds]
            exposures = range(arguments.frames)
            runs = [track(sequence, exposures, OPTIMIZERS[name], arguments.budget_ms) for sequence in sequences]
            print(f"| {name} | {scene} | {row(runs)} |", flush=True)


if __name__ == "__main__":
    main()
