"""Every optimiser on four scenes: errors, time and effort per frame.

The scenes: the demo's sheet; three times as fast; with a hand in front of it; and turned by 90° within a quarter of a
second, which no motion prior predicts. Without `budget_ms` the search ignores the clock. Times are CPU times of a whole
frame on one core, without capture and publication.

Statistic: mean vertex error over the frames of all seeds.
Goal: the default search has at most 1.1 times the error of the best one, in every scene.
Seeds: the context's + 1 to + 3.
"""

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from abs_service.report.content import Cell, Column, Section, Table
from abs_service.tracker.estimates.estimate import Estimate
from abs_service.tracker.optimizers import cma, cma_es, hybrid
from abs_service.tracking.log.truth import Errors
from abs_service.tracking.plan import OptimizerSettings
from abs_service.tracking.session import TrackingSession
from drivers.simulated.simulation import Simulation
from evaluation.experiment import Context, Findings, Goal, at_most
from evaluation.sequences import TruthEvaluator, demo_plan, demo_rig, expose, simulate

TITLE = "Optimisers: error, time and effort on four scenes"

SCENES: Mapping[str, str] = {"demo": "", "fast": "&speed=3", "hand": "&occluder=hand", "turn": "&turn=2"}
OPTIMIZERS: Mapping[str, OptimizerSettings] = {
    "hybrid": hybrid.Settings(),
    "cma_es": cma_es.Settings(),
    "cma": cma.Settings(),
}

#: The default search.
DEFAULT = "hybrid"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        seeds: of the simulated sequences, added to the context's seed.
        frames: of each sequence.
        scenes: names in `SCENES`.
        optimizers: names in `OPTIMIZERS`, with the default.
        budget_ms: time limit of a search [ms].
    """

    seeds: tuple[int, ...] = (1, 2, 3)
    frames: int = 180
    scenes: tuple[str, ...] = tuple(SCENES)
    optimizers: tuple[str, ...] = tuple(OPTIMIZERS)
    budget_ms: float = float("inf")


QUICK = Settings((1,), 12, ("demo",), ("hybrid", "cma_es"))


@dataclass(frozen=True)
class Run:
    """One optimiser on one sequence.

    Attributes:
        estimates: of all frames.
        errors: of the frames whose truth is known.
        times_ms: CPU time of each frame except the first [ms].
    """

    estimates: Sequence[Estimate]
    errors: Sequence[Errors]
    times_ms: Sequence[float]


_COLUMNS = (
    Column("optimizer"), Column("scene"), Column("vertex error", "mm", ".2f"), Column("surface error", "mm", ".2f"),
    Column("worst frame", "mm", ".1f"), Column("median", "ms", ".1f"), Column("95 %", "ms", ".1f"),
    Column("generations", "", ".1f"), Column("evaluations", "", ".0f"), Column("stop"),
)  # fmt: skip


def run(settings: Settings, context: Context) -> Findings:
    """Tracks every scene with every optimiser."""
    rows: list[tuple[Cell, ...]] = []
    values: dict[str, dict[str, float]] = {}
    for scene in settings.scenes:
        for name in settings.optimizers:
            context.progress(f"{scene}, {name}")
            simulations = [
                simulate(f"simulated://sheet?seed={context.seed + seed}{SCENES[scene]}") for seed in settings.seeds
            ]
            search = OPTIMIZERS[name]
            runs = [track(one, range(settings.frames), search, settings.budget_ms) for one in simulations]
            values[f"{scene}, {name}"] = figures = _figures(runs)
            rows.append((name, scene, *figures.values(), _stops([e for one in runs for e in one.estimates[1:]])))
    goals = tuple(_goal(scene, settings.optimizers, values) for scene in settings.scenes)
    table = Table(f"Frames {settings.frames}, seeds {len(settings.seeds)}", _COLUMNS, tuple(rows))
    return Findings(goals, (Section("Errors and effort", (table,)),), values)


def track(simulation: Simulation, indices: Sequence[int], settings: OptimizerSettings, budget_ms: float) -> Run:
    """Tracks exposures, each within a budget of wall-clock time."""
    session = TrackingSession(demo_rig(simulation), demo_plan(optimizer=settings))
    evaluator = TruthEvaluator(session)
    estimates, errors, times = [], [], []
    for k in indices:
        (exposure,) = expose(simulation, [k])
        start, start_cpu = time.monotonic(), time.process_time()
        estimates.append(session.track(exposure.frames, partial(_in_time, start + budget_ms * 1e-3)))
        times.append((time.process_time() - start_cpu) * 1e3)
        errors.append(evaluator.errors(estimates[-1], exposure.points))
    return Run(estimates, [one for one in errors if one is not None], times[1:])


def _in_time(until_s: float) -> bool:
    return time.monotonic() < until_s


def _figures(runs: Sequence[Run]) -> dict[str, float]:
    """Statistics of one optimiser and scene over all seeds, by name."""
    errors = [error for one in runs for error in one.errors]
    times = np.concatenate([one.times_ms for one in runs])
    estimates = [estimate for one in runs for estimate in one.estimates[1:]]
    return {
        "vertex_mm": float(np.mean([one.vertex_mm for one in errors])),
        "surface_mm": float(np.mean([one.surface_mm for one in errors])),
        "worst_mm": max(one.vertex_mm for one in errors),
        "median_ms": float(np.median(times)),
        "p95_ms": float(np.quantile(times, 0.95)),
        "generations": float(np.mean([estimate.search.generations for estimate in estimates])),
        "evaluations": float(np.mean([estimate.search.evaluations for estimate in estimates])),
    }


def _stops(estimates: Sequence[Estimate]) -> str:
    """Search and stop criterion of the estimates, the most frequent first."""
    found = Counter(f"{estimate.search.searcher} {estimate.search.stop}" for estimate in estimates)
    return ", ".join(f"{what} {count / len(estimates):.0%}" for what, count in found.most_common())


def _goal(scene: str, optimizers: Sequence[str], values: Mapping[str, Mapping[str, float]]) -> Goal:
    best = min(values[f"{scene}, {name}"]["vertex_mm"] for name in optimizers)
    name = f"{scene}: vertex error of {DEFAULT} / of the best optimiser"
    return at_most(name, values[f"{scene}, {DEFAULT}"]["vertex_mm"] / best, 1.1)
