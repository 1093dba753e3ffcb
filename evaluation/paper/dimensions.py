"""E6: models of 100 dimensions and more, and what accuracy a budget buys.

Statistic: mean vertex error of all frames and sequences.
Goals: 108 dimensions have at most 0.67 of the error of 48, and at most 1.5 mm; the default search has at most 1.1 times
the error of the best CMA-ES.
Seeds: two sequences, with the context's seed + 1 and + 2.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.report import plots
from abs_service.report.content import Column, Picture, Section, Table, drawing
from abs_service.tracker.models import nurbs
from abs_service.tracker.optimizers import cma, cma_es, hybrid
from abs_service.tracking.plan import OptimizerSettings
from calib.noise.images.intensity import GaussianIntensity
from calib.noise.tof_amplitude import TofAmplitude
from calib.rig import Rig, Sensor
from drivers.simulated.scene.texture import smooth_pattern
from evaluation.experiment import Context, Findings, Goal, at_most
from evaluation.scenes.exposure import LabeledExposure
from evaluation.scenes.time_of_flight import SR4000
from evaluation.scenes.waves import Waves
from evaluation.sequences import TrackedSequence, demo_plan, effort, track

TITLE = "E6: 108 dimensions and more, accuracy against budget"

#: The sensor's true noise model, and the noise model of its amplitudes as an image of the texture.
DEPTH = Sensor("tof", SR4000, TofAmplitude((0.0015,), 9.0))
PRINT = Sensor("tof/amplitude", SR4000, GaussianIntensity("amplitude", 50.0, relative=0.03))


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        sequences: each with a print and noise of its own.
        frames: of each sequence.
        interval_s: between frames.
        vertices: of the meshes.
        sizes: control points along each side, with the default search.
        size: control points along each side, for the comparison of budgets.
        cma_es_budgets: generations and population of CMA-ES.
        pycma_budgets: the same by pycma.
        steps: of the descent, for `hybrid`.
    """

    sequences: int = 2
    frames: int = 20
    interval_s: float = 0.2
    vertices: int = 400
    sizes: tuple[int, ...] = (4, 6, 8, 10)
    size: int = 6
    cma_es_budgets: tuple[tuple[int, int], ...] = (
        (3, 18),
        (10, 18),
        (30, 18),
        (100, 18),
        (300, 18),
        (100, 40),
        (300, 40),
    )
    pycma_budgets: tuple[tuple[int, int], ...] = ((10, 18), (100, 18))
    steps: tuple[int, ...] = (1, 2, 4, 12)


QUICK = Settings(
    sequences=1, frames=9, interval_s=0.2, vertices=300, sizes=(4, 6), cma_es_budgets=((10, 18), (30, 18)),
    pycma_budgets=((5, 18),), steps=(12,),
)  # fmt: skip


def run(settings: Settings, context: Context) -> Findings:
    """Tracks sheets in waves with models of several sizes, and one size with several budgets."""
    context.progress("images")
    times = np.arange(settings.frames) * settings.interval_s
    waves = [Waves(context.seed + 1 + number) for number in range(settings.sequences)]
    sequences = [one.exposures(times, _reflectivity(one)) for one in waves]
    both, depth = Rig("waves", {"tof": DEPTH, "tof/amplitude": PRINT}), Rig("waves", {"tof": DEPTH})
    sized: dict[str, list[TrackedSequence]] = {}
    for size in settings.sizes:
        context.progress(f"{size} × {size} control points")
        sized[f"{size} × {size}"] = _track(both, size, hybrid.Settings(), sequences, settings)
    context.progress("without amplitudes")
    name = f"{settings.size} × {settings.size}"
    alone = _track(depth, settings.size, hybrid.Settings(), sequences, settings)
    searched: dict[str, list[TrackedSequence]] = {}
    for title, search in _searches(settings).items():
        context.progress(title)
        searched[title] = _track(both, settings.size, search, sequences, settings)
    sections = (
        Section("The scene", (_about(waves[0]), _scene(sequences[0], sized[name][0]))),
        Section("Dimensions", (_table("By size", sized | {f"{name}, distances alone": alone}, "control points"),)),
        Section("Budget", (_table(f"{name} control points, by search", searched, "search"), _curve(searched))),
    )
    values = {title: _figures(runs) for title, runs in {**sized, **searched}.items()}
    return Findings(_goals(sized[name], next(iter(sized.values())), searched), sections, values)


def _reflectivity(sheet: Waves) -> NDArray[np.float32]:
    """Infra-red reflectivity of a sheet's texture (h, w)."""
    return smooth_pattern(sheet.seed, sheet.width, sheet.height, (0.02, 0.01), 400.0, (0.1, 0.95), (0.3, 0.9)).texels[
        ..., 3
    ]


def _goals(
    large: Sequence[TrackedSequence],
    small: Sequence[TrackedSequence],
    searched: Mapping[str, Sequence[TrackedSequence]],
) -> tuple[Goal, ...]:
    """The large model has a smaller error, and the default search is as good as the best CMA-ES."""
    best = min(_figures(runs)["vertex_mm"] for title, runs in searched.items() if "CMA-ES" in title)
    own, small_error = (_figures(runs)["vertex_mm"] for runs in (large, small))
    return (
        at_most("Vertex error of 108 dimensions / of 48", own / small_error, 0.67),
        at_most("Vertex error of 108 dimensions by the default search", own, 1.5, "mm"),
        at_most("Vertex error of the default search / of the best CMA-ES", own / best, 1.1),
    )


def _searches(settings: Settings) -> dict[str, OptimizerSettings]:
    found: dict[str, OptimizerSettings] = {}
    for steps in settings.steps:
        found[f"hybrid, {steps} steps"] = hybrid.Settings(steps=steps)
    for generations, population in settings.cma_es_budgets:
        found[f"CMA-ES, {generations} × {population}"] = cma_es.Settings(population, generations)
    for generations, population in settings.pycma_budgets:
        found[f"pycma, {generations} × {population}"] = cma.Settings(population, generations)
    return found


def _track(
    rig: Rig, size: int, search: OptimizerSettings, sequences: Sequence[Sequence[LabeledExposure]], settings: Settings
) -> list[TrackedSequence]:
    model = nurbs.Settings(control_points=(size, size))
    plan = demo_plan(model, optimizer=search, vertices=settings.vertices)
    return [track(rig, plan, exposures) for exposures in sequences]


def _figures(runs: Sequence[TrackedSequence]) -> dict[str, float]:
    return {
        "dimensions": float(runs[0].thetas.shape[1]),
        "vertex_mm": float(np.mean([one.vertex_mm for one in runs])),
        "surface_mm": float(np.mean([one.surface_mm for one in runs])),
        "control_mm": float(np.mean([control_error_mm(one) for one in runs])),
        **effort(runs),
        "relocations": float(np.sum([one.relocations for one in runs])),
    }


def control_error_mm(followed: TrackedSequence) -> float:
    """Mean distance [mm] of the control points from those whose mesh is nearest to the true material points.

    Control points at the rim are determined by few vertices.
    """
    errors = []
    for model, estimate, points in list(zip(followed.models, followed.estimates, followed.material))[1:]:
        jacobian = model.sparse_jacobian(estimate.theta).dense
        away = (points - estimate.vertices).ravel()
        off = np.linalg.lstsq(jacobian.reshape(away.size, -1), away, rcond=None)[0]
        errors.append(np.linalg.norm(off.reshape(-1, 3), axis=1).mean())
    return float(np.mean(errors) * 1e3)


def _about(waves: Waves) -> str:
    return (
        f"A sheet of {waves.width * 1e3:.0f} × {waves.height * 1e3:.0f} mm in standing waves, "
        f"{waves.length * 1e3:.0f} mm long and bent by up to {waves.curvature:g}/m, {waves.period:g} s a swing, while "
        "it turns and moves; no length changes. An SR4000 measures distances, and amplitudes that show the print. "
        "Distances alone do not hold a sheet that may slide along its own waves."
    )


def _table(caption: str, runs: Mapping[str, Sequence[TrackedSequence]], first: str) -> Table:
    columns = (
        Column(first), Column("dimensions", "", ".0f"), Column("vertex", "mm", ".2f"), Column("surface", "mm", ".2f"),
        Column("control points", "mm", ".2f"), Column("worst frame", "mm", ".2f"), Column("evaluations", "", ".0f"),
        Column("time", "ms", ".0f"), Column("TRACKING", "", ".0%"), Column("found again", "", ".0f"),
    )  # fmt: skip
    return Table(caption, columns, tuple((name, *_figures(one).values()) for name, one in runs.items()))


def _curve(searched: Mapping[str, Sequence[TrackedSequence]]) -> Picture:
    drawn = plots.figure(9, 3.4)
    both = drawn.subplots(1, 2, sharey=True)
    for axes, (by, label) in zip(both, (("evaluations", "evaluations"), ("median_ms", "time [ms]"))):
        for kind, mark in (("hybrid", "o"), ("CMA-ES", "s"), ("pycma", "^")):
            found = [_figures(runs) for title, runs in searched.items() if title.startswith(kind)]
            places = sorted((one[by], one["vertex_mm"]) for one in found)
            axes.plot(*np.transpose(places), f"{mark}-", ms=4, lw=1, label=kind)
        axes.set(xscale="log", yscale="log", xlabel=f"{label} a frame", ylabel="vertex error [mm]")
        axes.grid(color="0.9")
    both[0].legend()
    return drawing(drawn, "Accuracy against budget.", "The error falls with the budget and levels off")


def _scene(exposures: Sequence[LabeledExposure], followed: TrackedSequence) -> Picture:
    number = int(np.argmax([np.ptp(exposure.points[..., 2]) for exposure in exposures]))
    drawn = plots.figure(7, 3.2)
    axes = drawn.subplots()
    mesh = followed.estimates[number].vertices
    for points, shade, label in (
        (exposures[number].points.reshape(-1, 3), "0.75", "truth"),
        (mesh, "tab:blue", "found"),
    ):
        axes.plot(points[:, 0] * 1e3, points[:, 2] * 1e3, ".", color=shade, ms=3, label=label)
    axes.set(xlabel="to the right [mm]", ylabel="away from the sensor [mm]", aspect="equal")
    axes.legend(fontsize="small")
    return drawing(drawn, "The most bent frame from above.", "The mesh lies on a sheet in waves")
