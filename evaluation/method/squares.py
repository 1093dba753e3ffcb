"""The likelihood against squares with their default weights on the demo's sheet, and what explains the difference.

The default weights are those of σ = 10 mm and 15.8 levels, where the demo's sensors have about 4 mm and 2.5 levels: the
priors count more beside them. If that is what squares owe their error to, a likelihood whose σ are as large, and vary
from pixel to pixel as the true ones, beats them; if what counts is that the likelihood has an outline, one without it
does not differ; and if knowing σ per pixel is worth anything on this sheet, where it varies from 3 to 6.5 mm, the
likelihood beats squares with the weights of the mean σ.

Statistic: vertex error, mean over the frames of a sequence; upper end of the 95 % interval of the mean difference of
two cases, over the seeds.
Goals: not above 0 for the likelihood − squares with default weights; for the likelihood with σ as large as theirs −
squares with default weights; for the likelihood − squares with the weights of the mean σ.
Seeds: ten sequences, with the context's seed + 101 to + 110; `models` has others.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from abs_service.report.content import Column, Section, Table
from abs_service.tracker.models import nurbs
from abs_service.tracker.objectives import euclidean, likelihood
from abs_service.tracking.plan import ObjectiveSettings
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.images.color import GaussianColor
from calib.rig import Rig
from evaluation.experiment import Context, Findings, Goal, at_most
from evaluation.sequences import (
    PIXELS_ALONE,
    UntrackedError,
    demo_plan,
    demo_rig,
    euclidean_fitness,
    expose,
    mean_deviation,
    simulate,
    track,
    with_noise,
)
from evaluation.statistics import upper_end

TITLE = "Likelihood against squares with default weights on the demo's sheet, and what explains the difference"

#: Cases.
LIKELIHOOD, SQUARES, MEAN_WEIGHTS = "likelihood", "squares, default weights", "squares, weights of the mean σ"
AS_LARGE, NO_OUTLINE = "likelihood, σ as large as the default weights say", "likelihood without the outline"

#: Pairs of cases of which the first has to err less.
PAIRS = ((LIKELIHOOD, SQUARES), (AS_LARGE, SQUARES), (LIKELIHOOD, MEAN_WEIGHTS))

#: What is nearer than this is the sheet, not the wall [m].
NEAR_M = 1.3


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        seeds: of the simulated sequences, added to the context's seed.
        frames: of each sequence.
    """

    seeds: tuple[int, ...] = tuple(range(101, 111))
    frames: int = 120


QUICK = Settings((101, 102), 6)


def run(settings: Settings, context: Context) -> Findings:
    """Tracks the sheet with every fitness and every seed."""
    errors_mm: dict[str, list[float]] = {}
    for seed in settings.seeds:
        context.progress(f"seed {seed}")
        for name, error_mm in _errors(context.seed + seed, settings.frames).items():
            errors_mm.setdefault(name, []).append(error_mm)
    return Findings(_goals(errors_mm), (Section("Errors", (_table(errors_mm),)),), {"vertex_mm": errors_mm})


def _errors(seed: int, frames: int) -> Mapping[str, float]:
    """Vertex error [mm] of every case in one sequence."""
    simulation = simulate(f"simulated://sheet?seed={seed}")
    exposures, rig = expose(simulation, range(frames)), demo_rig(simulation)
    mean_m = mean_deviation(rig, "tof", exposures[0], NEAR_M)
    cases: Mapping[str, tuple[Rig, ObjectiveSettings]] = {
        LIKELIHOOD: (rig, likelihood.Settings()),
        SQUARES: (rig, euclidean.Settings()),
        MEAN_WEIGHTS: (rig, euclidean_fitness(mean_m)),
        AS_LARGE: (_with_large_sigma(rig, mean_m), likelihood.Settings()),
        NO_OUTLINE: (rig, PIXELS_ALONE),
    }
    return {
        name: track(of, demo_plan(nurbs.Settings(), objective=objective), exposures).vertex_mm
        for name, (of, objective) in cases.items()
    }


def _with_large_sigma(rig: Rig, mean_m: float) -> Rig:
    """The rig with σ as large on average as the default weights of squares say; that of distances varies as it does."""
    weights, noise = euclidean.Settings(), rig.sensors["tof"].noise
    if not isinstance(noise, GaussianPolynomial):
        raise UntrackedError("the demo's distances have another noise model than this experiment was made for")
    factor = (2 * weights.depth_weight) ** -0.5 / mean_m
    scaled = replace(noise, sigma=tuple(tuple(factor * one for one in row) for row in noise.sigma))
    return with_noise(with_noise(rig, "tof", scaled), "color", GaussianColor((2 * weights.color_weight) ** -0.5))


def _goals(errors_mm: Mapping[str, Sequence[float]]) -> tuple[Goal, ...]:
    return tuple(
        at_most(
            f"Vertex error, {first} − {second}, upper end of the 95 % interval",
            upper_end(errors_mm[first], errors_mm[second]),
            0.0,
            "mm",
        )
        for first, second in PAIRS
    )


def _table(errors_mm: Mapping[str, Sequence[float]]) -> Table:
    columns = (Column("fitness"), Column("vertex error", "mm", ".3f"), Column("SD of seeds", "mm", ".3f"))
    rows = tuple((name, float(np.mean(one)), float(np.std(one, ddof=1))) for name, one in errors_mm.items())
    return Table("Default model and search, two sensors", columns, rows)
