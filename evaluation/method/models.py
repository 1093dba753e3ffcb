"""Every deformation model on the same sequences of the demo rig: the table of docs/explanation/models.md.

Everything is as in the demo's configuration except the model, the search (`cma` unless stated) and the objective: the
likelihood, with or without texture registration noise, or squares with default weights. Means over the frames of a
sequence, then mean and standard deviation over the seeds.

Goals: 95 % of the frames are TRACKING in every case. Since 2026-11-25, on the sheet the likelihood beats squares with
their default weights: the upper end of the 95 % interval of the difference of the vertex errors, over the seeds, is not
above 0. Until then errors had no goal; it was known that 4 × 4 control points would meet this one, and that the default
model has 0.39 mm either way. `squares` asks why.
Seeds: five sequences, with the context's seed + 1 to + 5.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from abs_service.report.content import Cell, Column, Section, Table
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models import flexpad, gravity, nurbs, posed, rigid
from abs_service.tracker.objectives import euclidean, likelihood
from abs_service.tracker.optimizers import cma, hybrid
from abs_service.tracking.plan import ModelSettings, ObjectiveSettings, OptimizerSettings
from evaluation.experiment import Context, Findings, Goal, at_least, at_most
from evaluation.sequences import SMALL, demo_plan, demo_rig, expose, simulate, track
from evaluation.statistics import upper_end

TITLE = "Deformation models on the demo's sheet, strip and board"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        seeds: of the simulated sequences, added to the context's seed.
        frames: of each sequence.
    """

    seeds: tuple[int, ...] = (1, 2, 3, 4, 5)
    frames: int = 240


QUICK = Settings((1,), 6)


@dataclass(frozen=True)
class Case:
    """One row of the table: a model, its scene, objective and search."""

    name: str
    scene: str
    settings: ModelSettings
    objective: ObjectiveSettings = field(default_factory=likelihood.Settings)
    optimizer: OptimizerSettings = field(default_factory=cma.Settings)

    @property
    def texture_registration_px(self) -> float | None:
        """Texture registration noise of the likelihood [px]."""
        return self.objective.texture_registration_px if isinstance(self.objective, likelihood.Settings) else None


PRINT, SQUARES, HYBRID = likelihood.Settings(texture_registration_px=0.2), euclidean.Settings(), hybrid.Settings()

CASES = (
    Case("nurbs by default, hybrid", "sheet", nurbs.Settings(), optimizer=HYBRID),
    Case("nurbs by default, hybrid, squares", "sheet", nurbs.Settings(), SQUARES, HYBRID),
    Case("nurbs, 4 × 4, hybrid", "sheet", SMALL, optimizer=HYBRID),
    Case("nurbs, 4 × 4, hybrid, squares", "sheet", SMALL, SQUARES, HYBRID),
    Case("nurbs, 4 × 4", "sheet", SMALL),
    Case("nurbs, 4 × 4", "sheet", SMALL, PRINT),
    Case("posed, nurbs 4 × 4", "sheet", posed.Settings(SMALL)),
    Case("flexpad, size given", "sheet", flexpad.Settings(0.3, 0.2)),
    Case("flexpad, size detected", "sheet", flexpad.Settings()),
    Case("gravity, 8 segments, length given", "strip", gravity.Settings(length_m=0.3)),
    Case("rigid, hybrid", "board", rigid.Settings(), optimizer=HYBRID),
    Case("rigid, hybrid", "board", rigid.Settings(), PRINT, HYBRID),
    Case("rigid", "board", rigid.Settings(), PRINT),
    Case("nurbs, 4 × 4, hybrid", "board", SMALL, optimizer=HYBRID),
    Case("nurbs, 4 × 4, hybrid", "board", SMALL, PRINT, HYBRID),
)


@dataclass(frozen=True)
class Result:
    """Errors of one sequence.

    Attributes:
        vertex_mm, surface_mm: means [mm].
        worst_mm: vertex error of the worst frame [mm].
        stretch: root mean square of the relative change of the edge lengths.
        tracked: share of the frames that are TRACKING.
    """

    vertex_mm: float
    surface_mm: float
    worst_mm: float
    stretch: float
    tracked: float


def run(settings: Settings, context: Context) -> Findings:
    """Tracks all cases with all seeds."""
    rows: list[tuple[Cell, ...]] = []
    values, tracked = {}, []
    for case in CASES:
        name = f"{case.scene}, {case.name}" + (
            f", {case.texture_registration_px:g} px" if case.texture_registration_px else ""
        )
        context.progress(name)
        results = [measure(case, context.seed + seed, settings.frames) for seed in settings.seeds]
        rows.append(_row(case, results))
        tracked.append(float(np.mean([one.tracked for one in results])))
        values[name] = {key: [getattr(one, key) for one in results] for key in Result.__dataclass_fields__}
    goals = (
        at_least("Share of the frames that are TRACKING, the lowest of all cases", min(tracked), 0.95),
        *(_against_squares(name, values) for name in ("nurbs by default, hybrid", "nurbs, 4 × 4, hybrid")),
    )
    return Findings(goals, (Section("Errors", (Table("Every model", _COLUMNS, tuple(rows)),)),), values)


def _against_squares(name: str, values: Mapping[str, Mapping[str, Sequence[float]]]) -> Goal:
    """Goal on what the likelihood gains on the sheet."""
    errors = (values[f"sheet, {one}"]["vertex_mm"] for one in (name, f"{name}, squares"))
    title = f"Vertex error of the likelihood − squares with default weights, {name}, upper end of the 95 % interval"
    return at_most(title, upper_end(*errors), 0.0, "mm")


def measure(case: Case, seed: int, frames: int) -> Result:
    """Tracks one sequence."""
    simulation = simulate(f"simulated://{case.scene}?seed={seed}")
    plan = demo_plan(case.settings, optimizer=case.optimizer, objective=case.objective)
    found = track(demo_rig(simulation), plan, expose(simulation, range(frames)))
    changes = [
        _strain(one.mesh, estimate.vertices) for one, estimate in zip(found.models, found.estimates, strict=True)
    ]
    rms = float(np.sqrt(np.mean(np.square(np.concatenate(changes)))))
    return Result(found.vertex_mm, found.surface_mm, found.worst_mm, rms, found.tracked)


def _strain(mesh: Mesh, vertices: NDArray[np.floating]) -> NDArray[np.floating]:
    """Relative change (edges,) of the edge lengths."""
    (i, j), rest = mesh.edges.T, mesh.vertices
    return np.linalg.norm(vertices[i] - vertices[j], axis=1) / np.linalg.norm(rest[i] - rest[j], axis=1) - 1


_COLUMNS = (
    Column("scene"), Column("model"), Column("registration σ", "px", ".1f"), Column("vertex error", "mm", ".2f"),
    Column("SD", "mm", ".2f"), Column("surface error", "mm", ".2f"), Column("SD", "mm", ".2f"),
    Column("worst frame", "mm", ".2f"), Column("change of edges", "", ".2%"), Column("TRACKING", "", ".0%"),
)  # fmt: skip


def _row(case: Case, results: Sequence[Result]) -> tuple[Cell, ...]:
    spread = [
        float(np.std(errors, ddof=1)) if len(results) > 1 else None
        for errors in ([one.vertex_mm for one in results], [one.surface_mm for one in results])
    ]
    means = {key: float(np.mean([getattr(one, key) for one in results])) for key in Result.__dataclass_fields__}
    worst = max(one.worst_mm for one in results)
    return (
        case.scene, case.name, case.texture_registration_px, means["vertex_mm"], spread[0], means["surface_mm"],
        spread[1], worst, means["stretch"], means["tracked"],
    )  # fmt: skip
