"""E9: input warping (section 3.2 of the paper): what it costs in accuracy, what it saves, and how right it is.

Statistic: mean vertex and surface error and time of a candidate, warped over direct; share of the warped image that is
filled, its bias, the 95th percentile of its error, and its time.
Goals: error of vertices at most 1.5, of the surface 1.1, time 0.5 times; 95 % filled, bias 0.1 mm, 95 % of the errors
within 1.5 mm, 15 ms.
Seeds: three sequences and as many noises, with seeds that follow the context's.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass

import numpy as np

from abs_service.report.content import Column, Section, Table
from drivers.encoding.foreign_recording import ForeignRecordingError
from evaluation.experiment import Context, Findings, Goal, at_least, at_most
from evaluation.inputs.recordings import azure
from evaluation.inputs.warping import comparison, real, syntheses

__all__ = ["QUICK", "TITLE", "Settings", "run"]

TITLE = "E9: input warping: faster, less accurate?"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        sequences: that are tracked, with seeds that follow each other; as many noises of the warped depth images.
        frames: of each sequence.
        syntheses, scenes: which of them.
        rounds: how often a warp is timed.
    """

    sequences: int = 3
    frames: int = 120
    syntheses: tuple[str, ...] = tuple(syntheses.SYNTHESES)
    scenes: tuple[str, ...] = tuple(comparison.SCENES)
    rounds: int = 40


QUICK = Settings(1, 10, ("sparse", "warped"), ("board before a wall",), 3)


def run(settings: Settings, context: Context) -> Findings:
    """Tracks with every synthesis, then warps depth images by every method."""
    seeds = range(context.seed + 1, context.seed + 1 + settings.sequences)
    context.progress("exposures")
    sequences = [syntheses.recorded(seed, settings.frames) for seed in seeds]
    tracked = {}
    for name in settings.syntheses:
        context.progress(name)
        tracked[name] = syntheses.measured(syntheses.SYNTHESES[name], sequences)
    context.progress("candidates")
    candidates = syntheses.candidates_us(settings.syntheses, sequences[0])
    context.progress("warping")
    with ThreadPoolExecutor(2) as pool:
        warped = comparison.simulated(settings.scenes, seeds, settings.rounds, pool)
        sections = (_tracked(tracked, candidates), _warped(warped), _real(context, pool))
    values = {
        "tracked": {name: {**asdict(row), "candidate_us": candidates[name]} for name, row in tracked.items()},
        "warped": [asdict(r) for r in warped],
    }
    return Findings((*_tracked_goals(tracked, candidates), *_warped_goals(warped)), sections, values)


def _tracked_goals(rows: Mapping[str, syntheses.Row], candidates: Mapping[str, float]) -> tuple[Goal, ...]:
    """The paper's claim, as two ratios."""
    direct, warped = rows["sparse"], rows["warped"]
    error = float(np.mean(warped.vertex_mm) / np.mean(direct.vertex_mm))
    return (
        at_most("Time of a candidate, warped / direct", candidates["warped"] / candidates["sparse"], 0.5),
        at_most("Vertex error, warped / direct", error, 1.5),
        at_most("Surface error, warped / direct", warped.surface_mm / direct.surface_mm, 1.1),
    )


def _warped_goals(rows: Sequence[comparison.Row]) -> tuple[Goal, ...]:
    ours = [row for row in rows if row.method.startswith("mesh")]
    return (
        at_least("Filled by the warp, the least of the scenes", min(row.fill for row in ours), 95, "%", required=True),
        at_most("Bias of the warp, the largest", max(abs(row.bias_mm) for row in ours), 0.1, "mm", required=True),
        at_most("Error of 95 % of the pixels", max(row.p95_mm for row in ours), 1.5, "mm", required=True),
        at_most("Time of the warp", max(row.time_ms for row in ours), 15, "ms"),
    )


def _tracked(rows: Mapping[str, syntheses.Row], candidates: Mapping[str, float]) -> Section:
    columns = (
        Column("synthesis"),
        Column("vertex error (seeds)", "mm"),
        Column("surface error", "mm", ".2f"),
        Column("a frame", "ms", ".1f"),
        Column("a candidate", "µs", ".1f"),
    )
    cells = tuple(
        (
            name,
            f"{np.mean(row.vertex_mm):.2f} ({', '.join(f'{one:.2f}' for one in row.vertex_mm)})",
            row.surface_mm,
            row.frame_ms,
            candidates[name],
        )
        for name, row in rows.items()
    )
    return Section("Tracking", (syntheses.__doc__ or "", Table("Errors and processor time", columns, cells)))


def _warped(rows: Sequence[comparison.Row]) -> Section:
    columns = (
        *(Column("scene"), Column("method"), Column("fill", "%", ".1f"), Column("bias", "mm", "+.2f")),
        *(Column("p95", "mm", ".2f"), Column("time", "ms", ".1f")),
    )
    cells = tuple((r.scene, r.method, r.fill, r.bias_mm, r.p95_mm, r.time_ms) for r in rows)
    return Section("Warping depth", (comparison.__doc__ or "", Table("Against OpenCV", columns, cells)))


def _real(context: Context, pool: ThreadPoolExecutor) -> Section:
    title = "Real: one frame of an Azure Kinect"
    if context.data is None or not (context.data / azure.FOLDER).is_dir():
        return Section(title, (f"{azure.FOLDER} is not in the data folder.",))
    try:
        return real.section(azure.read(context.data / azure.FOLDER), pool)
    except ForeignRecordingError as error:
        return Section(title, (str(error),))
