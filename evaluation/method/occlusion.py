"""A hand passes in front of the sheet: error of the visible and of the occluded vertices.

The same frames with and without the hand. The simulator's geometry decides which vertices are occluded in the
time-of-flight head, not the tracker.

Statistic: mean vertex error of the visible vertices with the hand over that without, in the frames in which it hides
part of the sheet, of every seed.
Goal: at most 1.5, the largest of the seeds.
Seeds: the context's + 1 to + 3.
"""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.report.content import Column, Section, Table
from drivers.simulated.simulation import Simulation
from evaluation.experiment import Context, Findings, at_most
from evaluation.sequences import demo_plan, demo_rig, expose, simulate, track

TITLE = "Occlusion: a hand passes in front of the sheet"

#: Frames with a smaller share of occluded vertices are ignored.
MIN_SHARE = 0.05


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        seeds: of the simulated sequences, added to the context's seed.
        frames: of each sequence; the hand passes at about the 130th.
    """

    seeds: tuple[int, ...] = (1, 2, 3)
    frames: int = 240


QUICK = Settings((1,), 140)


@dataclass(frozen=True)
class Occlusion:
    """Errors in the frames in which the hand occludes part of the sheet.

    Attributes:
        share: largest share of occluded vertices.
        plain_mm: mean vertex error without the hand [mm].
        visible_mm: with the hand, of the visible vertices [mm].
        occluded_mm: with the hand, of the occluded vertices [mm].
    """

    share: float
    plain_mm: float
    visible_mm: float
    occluded_mm: float


def run(settings: Settings, context: Context) -> Findings:
    """Tracks the demo rig's sheet with and without the hand."""
    found = {}
    for seed in settings.seeds:
        context.progress(f"seed {context.seed + seed}")
        found[context.seed + seed] = measure(context.seed + seed, settings.frames)
    ratios = [one.visible_mm / one.plain_mm for one in found.values()]
    columns = (
        Column("seed"), Column("occluded, maximum", "", ".0%"), Column("without the hand", "mm", ".2f"),
        Column("visible vertices", "mm", ".2f"), Column("visible / without", "", ".2f"),
        Column("occluded vertices", "mm", ".2f"),
    )  # fmt: skip
    rows = tuple(
        (seed, one.share, one.plain_mm, one.visible_mm, ratio, one.occluded_mm)
        for (seed, one), ratio in zip(found.items(), ratios)
    )
    return Findings(
        (at_most("Error of the visible vertices with / without the hand, the largest of the seeds", max(ratios), 1.5),),
        (Section("Errors", (Table("Mean vertex errors while the hand passes", columns, rows),)),),
        {str(seed): asdict(one) for seed, one in found.items()},
    )


def measure(seed: int, frames: int) -> Occlusion:
    """Tracks one sequence with and without the hand."""
    plain = errors(simulate(f"simulated://sheet?seed={seed}"), frames)[0]
    error, occluded = errors(simulate(f"simulated://sheet?seed={seed}&occluder=hand"), frames)
    crossed = occluded.mean(axis=1) > MIN_SHARE
    return Occlusion(
        share=float(occluded.mean(axis=1).max()),
        plain_mm=float(plain[crossed].mean()),
        visible_mm=float(error[crossed][~occluded[crossed]].mean()),
        occluded_mm=float(error[crossed][occluded[crossed]].mean()),
    )


def errors(simulation: Simulation, frames: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Error of every vertex [mm], and mask of those occluded in the time-of-flight head, each (frames, n)."""
    found = track(demo_rig(simulation), demo_plan(), expose(simulation, range(frames)))
    eye = simulation.heads["tof"].camera.center
    distances, occluded = [], []
    for k, (estimate, points) in enumerate(zip(found.estimates, found.material)):
        distances.append(np.linalg.norm(estimate.vertices - points, axis=1) * 1e3)
        moment = simulation.scene.at(simulation.time_ns(k) * 1e-9)
        # 1 mm towards the camera, so that the sheet does not occlude its own points.
        before = points + (eye - points) * (1e-3 / np.linalg.norm(eye - points, axis=1, keepdims=True))
        occluded.append(moment.hidden(before[None], eye)[0])
    return np.array(distances), np.array(occluded)
