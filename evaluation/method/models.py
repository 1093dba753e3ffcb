"""What each deformation model makes of the same sequences: the table of docs/models.md.

  python -m evaluation.method.models [--seeds 1 2 3 4 5] [--frames 240]

The demo rig, offline, with everything as in its configuration but the model, the search, which is `cma` unless said,
and the misplacement of the print. Means over the frames of a sequence, then mean and standard deviation
over the seeds.
"""

import argparse
from dataclasses import dataclass, field

import numpy as np

from abs_service.tracker.estimate import Status
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models import flexpad, gravity, nurbs, posed, rigid
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.optimizers import cma, hybrid
from abs_service.tracking.session import ModelSettings, OptimizerSettings, Tracking
from tests.tracker.driving import default_plan, drive, mean_errors, rig_of, simulate


@dataclass(frozen=True)
class Case:
    """One line of the table: a model, the simulator's scene that it tracks, and `misplacement_px` of the likelihood."""

    name: str
    scene: str
    settings: ModelSettings
    misplacement_px: float = 0.0
    optimizer: OptimizerSettings = field(default_factory=cma.Settings)


CASES = (
    Case("`nurbs`, 4 × 4", "sheet", nurbs.Settings()),
    Case("`nurbs`, 4 × 4", "sheet", nurbs.Settings(), misplacement_px=0.2),
    Case("`posed`, `nurbs` 4 × 4", "sheet", posed.Settings(nurbs.Settings())),
    Case("`flexpad`, size given", "sheet", flexpad.Settings(0.3, 0.2)),
    Case("`flexpad`, size detected", "sheet", flexpad.Settings()),
    Case("`gravity`, 8 segments, length given", "strip", gravity.Settings(length_m=0.3)),
    Case("`rigid`, `hybrid`", "board", rigid.Settings(), optimizer=hybrid.Settings()),
    Case("`rigid`, `hybrid`", "board", rigid.Settings(), misplacement_px=0.2, optimizer=hybrid.Settings()),
    Case("`rigid`", "board", rigid.Settings(), misplacement_px=0.2),
    Case("`nurbs`, 4 × 4, `hybrid`", "board", nurbs.Settings(), optimizer=hybrid.Settings()),
    Case("`nurbs`, 4 × 4, `hybrid`", "board", nurbs.Settings(), misplacement_px=0.2, optimizer=hybrid.Settings()),
)


@dataclass(frozen=True)
class Result:
    """One sequence.

    Attributes:
        vertex_mm, surface_mm: mean errors [mm].
        worst_mm: vertex error of the worst frame [mm].
        stretch: root mean square of the relative change of the edges' lengths.
        share: of the frames that are TRACKING.
    """

    vertex_mm: float
    surface_mm: float
    worst_mm: float
    stretch: float
    share: float


def result(case: Case, seed: int, frames: int) -> Result:
    """Tracks one sequence."""
    simulation = simulate(f"simulated://{case.scene}?seed={seed}")
    objective = likelihood.Settings(misplacement_px=case.misplacement_px)
    plan = default_plan(model=case.settings, optimizer=case.optimizer, objective=objective)
    tracking = Tracking(rig_of(simulation), plan)
    steps = list(drive(tracking, simulation, range(frames)))
    if tracking.mesh is None:
        raise RuntimeError(f"{case.name} found nothing in {simulation}")
    changes = [stretches(tracking.mesh, step.estimate.vertices) for step in steps]
    return Result(
        *mean_errors(steps),
        worst_mm=max(step.errors.vertex_mm for step in steps if step.errors is not None),
        stretch=float(np.sqrt(np.mean(np.square(changes)))),
        share=float(np.mean([step.estimate.status == Status.TRACKING for step in steps])),
    )


def stretches(mesh: Mesh, vertices: np.ndarray) -> np.ndarray:
    """Relative change (edges,) of the edges' lengths."""
    (i, j), rest = mesh.edges.T, mesh.vertices
    return np.linalg.norm(vertices[i] - vertices[j], axis=1) / np.linalg.norm(rest[i] - rest[j], axis=1) - 1


def row(case: Case, seeds: list[int], frames: int) -> str:
    """One line of the table."""
    results = [result(case, seed, frames) for seed in seeds]
    vertex, surface = ([getattr(one, name) for one in results] for name in ("vertex_mm", "surface_mm"))
    return (
        f"| {case.scene} | {case.name} | {case.misplacement_px:.1f} | "
        f"{np.mean(vertex):.2f} ± {np.std(vertex, ddof=1):.2f} | "
        f"{np.mean(surface):.2f} ± {np.std(surface, ddof=1):.2f} | {max(one.worst_mm for one in results):.2f} | "
        f"{np.mean([one.stretch for one in results]):.2%} | {np.mean([one.share for one in results]):.0%} |"
    )


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--frames", type=int, default=240)
    arguments = parser.parse_args()
    print("| scene | model | misplacement px | vertex mm | surface mm | worst frame mm | edges change by | TRACKING |")
    print("|---|---|---|---|---|---|---|---|")
    for case in CASES:
        print(row(case, arguments.seeds, arguments.frames), flush=True)


if __name__ == "__main__":
    main()
