"""What a reader asks: what does each part contribute, and how much does it matter how much of it there is?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from abs_service.experiments import plots
from abs_service.experiments.base import Context, Findings, Goal, at_least, at_most
from abs_service.experiments.cold import Cold, Forgetful
from abs_service.experiments.tracked import Followed, Shot, demo_plan, demo_rig, follow, shoot, simulate
from abs_service.report.content import Column, Picture, Section, Table, drawing
from abs_service.tracker import priors
from abs_service.tracker.models import flexpad, nurbs
from abs_service.tracker.optimizers import cma_es, hybrid
from abs_service.tracking import Plan
from calib.noise.tof_amplitude import TofAmplitude
from calib.rig import Rig
from drivers.simulated.time_of_flight import TimeOfFlightNoise

TITLE = "Ablations: vertices, budget, warm start, priors, noise model"

#: As good as no prior at all.
FREE = 1e3


@dataclass(frozen=True)
class Settings:
    """How much is measured.

    Attributes:
        seeds: sequences, each with a motion, print and noise of its own.
        frames: of each.
        every: exposures from one frame to the next, at 30 Hz.
        bend: largest angle between two ends of the sheet [degrees].
        speed: of all motion, by that of the demo.
        noise: of all sensors, by that of the demo.
        vertices, populations, generations: that are tried.
        factors: on the σ of distances that the tracker believes in.
    """

    seeds: int = 3
    frames: int = 30
    every: int = 4
    bend: float = 90.0
    speed: float = 2.0
    noise: float = 1.5
    vertices: tuple[int, ...] = (100, 200, 400, 800, 1600)
    populations: tuple[int, ...] = (8, 16, 32, 64)
    generations: tuple[int, ...] = (3, 10, 30, 100, 300, 1000)
    factors: tuple[float, ...] = (0.5, 1.0, 2.0)


QUICK = Settings(seeds=1, frames=7, every=6, vertices=(100, 300), populations=(8, 32), generations=(3, 30))


@dataclass(frozen=True, eq=False)
class Variant:
    """One line of a table.

    Attributes:
        name: what is different.
        plan: of the tracker.
        rig: the sensors as the tracker believes that they are.
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
    rig = believed(settings.noise, 1.0)
    search = cma_es.Settings()
    tried = [
        _question("Vertices", rig, {f"{count}": {"vertices": count} for count in settings.vertices}),
        _question(
            "Population of CMA-ES, 30 generations",
            rig,
            {f"{count}": {"optimizer": cma_es.Settings(count, 30)} for count in settings.populations},
        ),
        _question(
            "Generations of CMA-ES, 16 candidates",
            rig,
            {f"{count}": {"optimizer": cma_es.Settings(16, count)} for count in settings.generations},
        ),
        _question(
            "Warm start of CMA-ES, 20 generations",
            rig,
            {
                "prediction, step size and covariance": {"optimizer": search},
                "prediction alone": {"optimizer": Forgetful(search)},
                "none: every frame begins at rest": {"optimizer": Cold(search)},
            },
        ),
        _question("Warm start of hybrid", rig, {"prediction": {}, "none": {"optimizer": Cold(hybrid.Settings())}}),
        _question("Priors, NURBS", rig, {name: {"priors": one} for name, one in PRIORS.items()}),
        _question(
            "Priors, FlexPad",
            rig,
            {name: {"model": flexpad.Settings(0.3, 0.2), "priors": one} for name, one in PRIORS.items()}
            | {"bends free": {"model": flexpad.Settings(0.3, 0.2, bend_deviation=FREE)}},
        ),
    ]
    wrong = [
        Variant(f"{factor:g} σ", demo_plan(nurbs.Settings()), believed(settings.noise, factor))
        for factor in settings.factors
    ]
    return [*tried, Question("σ of distances that is believed", tuple(wrong))]


#: By what is left out. Without the motion prior nothing but the last frame's solution, where a search begins, is kept.
PRIORS: Mapping[str, priors.Settings] = {
    "all": priors.Settings(),
    "no stretch prior": priors.Settings(stretch=FREE),
    "no motion prior": priors.Settings(speed=FREE),
    "no prediction": priors.Settings(memory_s=1e-6),
    "neither stretch nor motion": priors.Settings(stretch=FREE, speed=FREE),
}


def believed(noise: float, factor: float) -> Rig:
    """The demo's sensors, which err by `noise` of what they err there; distances by a σ that is wrong by a factor."""
    rig = demo_rig(simulate("simulated://sheet"))
    law, true = factor * noise, TimeOfFlightNoise()
    depth = TofAmplitude((law * true.sigma_offset, law * true.sigma_distance), law * true.sigma_amplitude)
    return replace(rig, sensors={**rig.sensors, "tof": replace(rig.sensors["tof"], noise=depth)})


def _question(title: str, rig: Rig, lines: Mapping[str, Mapping[str, Any]]) -> Question:
    plans = {name: demo_plan(**{"model": nurbs.Settings(), **changes}) for name, changes in lines.items()}
    return Question(title, tuple(Variant(name, plan, rig) for name, plan in plans.items()))


def run(settings: Settings, context: Context) -> Findings:
    """Answers all questions on the same sequences."""
    context.progress("images")
    sequences = [_shots(settings, context.seed + 1 + number) for number in range(settings.seeds)]
    found: dict[str, dict[str, list[Followed]]] = {}
    for question in questions(settings):
        found[question.title] = {}
        for variant in question.variants:
            context.progress(f"{question.title}: {variant.name}")
            found[question.title][variant.name] = [follow(variant.rig, variant.plan, shots) for shots in sequences]
    sections = (
        Section("The scene", (_about(settings), _scene(sequences[0]))),
        *(Section(title, (_table(title, lines),)) for title, lines in found.items()),
        Section("Curves", (_curves(found),)),
    )
    values = {title: {name: _figures(runs) for name, runs in lines.items()} for title, lines in found.items()}
    return Findings(_goals(values), sections, values)


def _shots(settings: Settings, seed: int) -> list[Shot]:
    motion = f"bend={settings.bend:g}&speed={settings.speed:g}&noise={settings.noise:g}"
    exposures = [0, *range(40, 40 + settings.every * settings.frames, settings.every)]
    return shoot(simulate(f"simulated://sheet?seed={seed}&{motion}"), exposures)


def _goals(values: Mapping[str, Mapping[str, Mapping[str, float]]]) -> tuple[Goal, ...]:
    """What must hold whatever the figures are: no part of the default is a burden."""
    sigma = values["σ of distances that is believed"]
    wrong = max(figures["vertex_mm"] for figures in sigma.values()) / sigma["1 σ"]["vertex_mm"]
    of_priors = values["Priors, NURBS"]
    without = min(figures["vertex_mm"] for name, figures in of_priors.items() if name != "all")
    return (
        at_most("Vertex error with a σ that is wrong by 2 / with the right one", wrong, 1.25),
        at_least(
            "Vertex error without the least useful prior / with all", without / of_priors["all"]["vertex_mm"], 0.98
        ),
    )


def _figures(runs: Sequence[Followed]) -> dict[str, float]:
    vertex = [one.vertex_mm for one in runs]
    return {
        "vertex_mm": float(np.mean(vertex)),
        "vertex_sd_mm": float(np.std(vertex)),
        "surface_mm": float(np.mean([one.surface_mm for one in runs])),
        "worst_mm": max(one.worst_mm for one in runs),
        "evaluations": float(np.mean([one.evaluations for one in runs])),
        "median_ms": float(np.median([one.median_ms for one in runs])),
        "tracked": float(np.mean([one.tracked for one in runs])),
        "residual_variance": float(
            np.mean([e.fits[0].normalized_residual ** 2 for one in runs for e in one.estimates if e.fits])
        ),
    }


def _about(settings: Settings) -> str:
    return (
        f"The demo's sheet, bent by up to {settings.bend:g}°, {settings.speed:g} times as fast, with "
        f"{settings.noise:g} times the noise, one image in {settings.every / 30:.2g} s; time of flight and colour. "
        "Whatever a line does not say is the default: NURBS of 4 × 4 control points, 300 vertices, hybrid. Figures are "
        "means over the sequences."
    )


def _table(caption: str, lines: Mapping[str, Sequence[Followed]]) -> Table:
    columns = (
        Column(""), Column("vertex", "mm", ".2f"), Column("SD of the sequences", "mm", ".2f"),
        Column("surface", "mm", ".2f"), Column("worst frame", "mm", ".1f"), Column("evaluations", "", ".0f"),
        Column("time", "ms", ".0f"), Column("TRACKING", "", ".0%"), Column("variance of depth residuals", "", ".2f"),
    )  # fmt: skip
    return Table(caption, columns, tuple((name, *_figures(runs).values()) for name, runs in lines.items()))


def _curves(found: Mapping[str, Mapping[str, Sequence[Followed]]]) -> Picture:
    counted = [title for title, lines in found.items() if all(name.isdigit() for name in lines)]
    drawn = plots.figure(11, 3.2)
    for axes, title in zip(drawn.subplots(1, len(counted)), counted):
        counts = [int(name) for name in found[title]]
        for name, mark in (("vertex_mm", "o-"), ("surface_mm", "s--")):
            axes.plot(counts, [_figures(runs)[name] for runs in found[title].values()], mark, ms=4, label=name[:-3])
        axes.set(xscale="log", xlabel=title, ylabel="error [mm]", ylim=(0, None))
        axes.grid(color="0.9")
        axes.legend()
    return drawing(drawn, "Error against what there is of each.", "Errors fall and level off")


def _scene(shots: Sequence[Shot]) -> Picture:
    drawn = plots.figure(9, 3.2)
    frames = shots[-1].frames.frames
    for axes, key in zip(drawn.subplots(1, 3), (("tof", "depth"), ("tof", "amplitude"), ("color", "color"))):
        image = frames[key].data
        axes.imshow(image, cmap="gray" if key[1] == "amplitude" else "viridis_r")
        axes.set(title=f"{key[0]}/{key[1]}", xticks=(), yticks=())
    return drawing(drawn, "The last moment of the first sequence.", "A bent sheet before a wall")
