"""Ablations: contribution of each part of the method, and of its size.

Statistic: vertex error, the mean over the frames of a sequence; its mean and standard deviation over the sequences.
Goals: a wrong σ costs at most 25 %; leaving out the least useful prior gains at most 2 %; the descent errs no more than
the best plain CMA-ES with the paper's budget or a tenth of its generations.
Seeds: three sequences, with the context's seed + 1 to + 3. Constants of the plain search were chosen on the sequence
101, which is not judged.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from abs_service.report.content import Section
from abs_service.tracker.models import flexpad
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.optimizers import cma_es, hybrid
from abs_service.tracker.posterior.priors import settings as priors
from abs_service.tracking.plan import Plan
from calib.noise.base import DepthNoise
from calib.noise.constant import Constant
from calib.noise.tof_amplitude import TofAmplitude
from calib.rig import Rig
from drivers.simulated.sensors.time_of_flight import TimeOfFlightNoise
from evaluation.experiment import Context, Findings, Goal, at_least, at_most
from evaluation.method.ablations import plain_cma, report, unmatched
from evaluation.method.ablations.cold_start import Cold, Forgetful
from evaluation.scenes.exposure import LabeledExposure
from evaluation.sequences import (
    SMALL,
    TrackedSequence,
    demo_plan,
    demo_rig,
    expose,
    moving_indices,
    simulate,
    track,
    with_noise,
)

TITLE = "Ablations: vertices, budget, warm start, priors, noise model"

#: Deviation of a prior that is switched off.
FREE = 1e3

#: The table of CMA-ES as in the paper, and of what was added to it.
ADDITIONS = "CMA-ES as in the paper, and with each addition"

#: Of the demo's time-of-flight sensor, on its sheet [m].
MEAN_DEVIATION = 4.5e-3


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        seeds: sequences, each with a motion, print and noise of its own.
        frames: of each.
        stride: exposures from one frame to the next, at 30 Hz.
        bend: largest angle between two ends of the sheet [degrees].
        speed: of all motion, by that of the demo.
        noise: of all sensors, by that of the demo.
        vertices, populations, generations: that are tried.
        paper_budget: generations and population of the plain CMA-ES, as in the paper.
        sigma_factors: of the σ of distances in the tracker's noise model.
    """

    seeds: int = 3
    frames: int = 30
    stride: int = 4
    bend: float = 90.0
    speed: float = 2.0
    noise: float = 1.5
    vertices: tuple[int, ...] = (100, 200, 400, 800, 1600)
    populations: tuple[int, ...] = (8, 16, 32, 64)
    generations: tuple[int, ...] = (3, 10, 30, 100, 300, 1000)
    paper_budget: tuple[int, int] = (1000, 32)
    sigma_factors: tuple[float, ...] = (0.5, 1.0, 2.0)


QUICK = Settings(
    seeds=1, frames=7, stride=6, vertices=(100, 300), populations=(8, 32), generations=(3, 30), paper_budget=(20, 16)
)


@dataclass(frozen=True, eq=False)
class Variant:
    """One line of a table.

    Attributes:
        name: of the variant.
        plan: of the tracker.
        rig: sensors with the tracker's noise models.
    """

    name: str
    plan: Plan
    rig: Rig


@dataclass(frozen=True, eq=False)
class Question:
    """One table.

    Attributes:
        title: of the table.
        variants: its lines.
    """

    title: str
    variants: tuple[Variant, ...]


def questions(settings: Settings) -> list[Question]:
    """All tables, one for every question."""
    rig = assumed_rig(settings.noise, 1.0)
    tried = [
        _question("Vertices", rig, {f"{count}": {"vertices": count} for count in settings.vertices}),
        *_of_searches(settings, rig),
        _question("Priors, NURBS", rig, {name: {"priors": one} for name, one in PRIORS.items()}),
        _question(
            "Priors, FlexPad",
            rig,
            {name: {"model": flexpad.Settings(0.3, 0.2), "priors": one} for name, one in PRIORS.items()}
            | {"bends free": {"model": flexpad.Settings(0.3, 0.2, bend_deviation=FREE)}},
        ),
    ]
    return [*tried, Question("Noise model of distances", _noise_variants(settings))]


def _of_searches(settings: Settings, rig: Rig) -> list[Question]:
    """Questions on the budget, the cost and the start of a search."""
    populations = {f"{count}": {"optimizer": cma_es.Settings(count, 30)} for count in settings.populations}
    generations = {f"{count}": {"optimizer": cma_es.Settings(16, count)} for count in settings.generations}
    widened = {count: {**changes, "objective": REGISTRATION} for count, changes in generations.items()}
    alone: dict[str, Any] = {"objective": unmatched.Settings()}
    additions = {name: {"optimizer": one, **alone} for name, one in plain_cma.additions(*settings.paper_budget).items()}
    additions |= {name: {"optimizer": one} for name, one in plain_cma.MATCHED.items()}
    starts = {
        "where images show the print, step size and covariance": {"optimizer": cma_es.Settings()},
        "prediction, step size and covariance": {"optimizer": cma_es.Settings(), **alone},
        "prediction alone": {"optimizer": Forgetful(cma_es.Settings()), **alone},
        "none: every frame begins at rest": {"optimizer": Cold(cma_es.Settings())},
    }
    hybrids = {"where images show the print": {}, "prediction": alone, "none": {"optimizer": Cold(hybrid.Settings())}}
    return [
        _question("Population of CMA-ES, 30 generations", rig, populations),
        _question("Generations of CMA-ES, 16 candidates", rig, generations),
        _question("Generations of CMA-ES, texture registration noise of 0.2 px", rig, widened),
        _question(ADDITIONS, rig, additions),
        _question("Warm start of CMA-ES, 20 generations", rig, starts),
        _question("Warm start of hybrid", rig, hybrids),
    ]


def _noise_variants(settings: Settings) -> tuple[Variant, ...]:
    """The true noise model with a scaled σ, and simpler models."""
    plan = demo_plan()
    laws = {f"{factor:g} σ": assumed_rig(settings.noise, factor) for factor in settings.sigma_factors}
    laws["one σ everywhere"] = _with_noise(Constant(settings.noise * MEAN_DEVIATION))
    return tuple(Variant(name, plan, rig) for name, rig in laws.items())


#: Allows for colours that are not quite where they belong, which makes the cost of a frame smoother.
REGISTRATION = likelihood.Settings(texture_registration_px=0.2)

#: By what is left out. Without the motion prior nothing but the last frame's solution, where a search begins, is kept.
PRIORS: Mapping[str, priors.Settings] = {
    "all": priors.Settings(),
    "no stretch prior": priors.Settings(stretch=FREE),
    "no motion prior": priors.Settings(speed=FREE, minimum_speed=FREE),
    "fixed motion prior": priors.Settings(minimum_speed=priors.Settings().speed),
    "no prediction": priors.Settings(memory_s=1e-6),
    "neither stretch nor motion": priors.Settings(stretch=FREE, speed=FREE, minimum_speed=FREE),
}


def assumed_rig(noise: float, factor: float) -> Rig:
    """Demo rig whose sensors have `noise` times the demo's noise, with the σ of distances scaled by `factor`."""
    law, true = factor * noise, TimeOfFlightNoise()
    return _with_noise(TofAmplitude((law * true.sigma_offset, law * true.sigma_distance), law * true.sigma_amplitude))


def _with_noise(noise: DepthNoise) -> Rig:
    return with_noise(demo_rig(simulate("simulated://sheet")), "tof", noise)


def _question(title: str, rig: Rig, lines: Mapping[str, Mapping[str, Any]]) -> Question:
    plans = {name: demo_plan(**{"model": SMALL, **changes}) for name, changes in lines.items()}
    return Question(title, tuple(Variant(name, plan, rig) for name, plan in plans.items()))


def run(settings: Settings, context: Context) -> Findings:
    """Answers all questions on the same sequences."""
    context.progress("images")
    sequences = [_exposures(settings, context.seed + 1 + number) for number in range(settings.seeds)]
    found: dict[str, dict[str, list[TrackedSequence]]] = {}
    for question in questions(settings):
        found[question.title] = {}
        for variant in question.variants:
            context.progress(f"{question.title}: {variant.name}")
            found[question.title][variant.name] = [
                track(variant.rig, variant.plan, exposures) for exposures in sequences
            ]
    sections = (
        Section("The scene", (_about(settings), report.scene(sequences[0]))),
        *(Section(title, (report.table(title, lines),)) for title, lines in found.items()),
        Section("Curves", (report.curves(found),)),
    )
    values = {title: {name: report.figures(runs) for name, runs in lines.items()} for title, lines in found.items()}
    return Findings(_goals(values), sections, values)


def _exposures(settings: Settings, seed: int) -> list[LabeledExposure]:
    motion = f"bend={settings.bend:g}&speed={settings.speed:g}&noise={settings.noise:g}"
    simulation = simulate(f"simulated://sheet?seed={seed}&{motion}")
    return expose(simulation, moving_indices(settings.frames, settings.stride))


def _goals(values: Mapping[str, Mapping[str, Mapping[str, float]]]) -> tuple[Goal, ...]:
    """Goals: no part of the default setup increases the error."""
    sigma = values["Noise model of distances"]
    wrong = max(sigma[name]["vertex_mm"] for name in sigma if name.endswith(" σ")) / sigma["1 σ"]["vertex_mm"]
    of_priors = values["Priors, NURBS"]
    without = min(figures["vertex_mm"] for name, figures in of_priors.items() if name != "all")
    searched = {name: figures["vertex_mm"] for name, figures in values[ADDITIONS].items()}
    return (
        at_most("Vertex error with a σ that is wrong by 2 / with the right one", wrong, 1.25),
        at_least(
            "Vertex error without the least useful prior / with all", without / of_priors["all"]["vertex_mm"], 0.98
        ),
        at_most(
            "Vertex error of hybrid / of the best plain CMA-ES",
            searched[plain_cma.HYBRID]
            / min(searched[name] for name in (plain_cma.PAPER, plain_cma.PAPER_WIDE, plain_cma.TENTH)),
            1.0,
        ),
    )


def _about(settings: Settings) -> str:
    return (
        f"The demo's sheet, bent by up to {settings.bend:g}°, {settings.speed:g} times as fast, with "
        f"{settings.noise:g} times the noise, one image in {settings.stride / 30:.2g} s; time of flight and colour. "
        "Everything else is the default: NURBS of 4 × 4 control points, 300 vertices, hybrid. Figures are "
        "means over the sequences."
    )
