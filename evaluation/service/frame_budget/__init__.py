"""A rig of today on two cores: depth of 640 × 480 and colour of 1280 × 720 pixels, 30 Hz, 600 vertices, NURBS 6 × 6.

The simulated device is recorded first, so that no simulation competes. One process then takes the recording frame by
frame; afterwards it is the live device of the whole service, which records what it publishes.

Statistic: median and 95th percentile of the times of single frames in one pass, from the pairing of the images to the
bytes of the estimate, without the first five; CPU time of every stage of such a frame in a second pass, in which the
functions at which the stages begin are wrapped (`stages`); beside it, in that pass, the CPU time of a plain copy of
the images. Live: percentiles of the ages at publication, frame sets that were passed over, and CPU time per time of
every process.
Goals: 7 and 10 ms; ages of 20 ms (median) and 50 ms (99th percentile), no set passed over, 0.35 of a core for the
tracker and 1.2 for all processes.
Seeds: one recording of each depth head with the context's seed + 1.

Easier than reality: the sheet covers an eighth of the depth image, and recorded cameras need no driver.
"""

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from abs_service.report.content import Column, Section, Table
from evaluation.experiment import Context, Findings, Goal, UnavailableError, at_most
from evaluation.service.frame_budget import live, offline
from evaluation.service.frame_budget.live import Observed
from evaluation.service.frame_budget.offline import Pass
from evaluation.service.frame_budget.rig import EXPOSURE_BYTES, RATE_HZ, write_take
from evaluation.service.frame_budget.stages import COPY, READ, STAGES

TITLE = "A rig of today: where the time of a frame goes"

#: Bounds of the goals.
MEDIAN_MS, P95_MS, AGE_P50_MS, AGE_P99_MS, TRACKER_CORES, ALL_CORES = 7.0, 10.0, 20.0, 50.0, 0.35, 1.2

#: Depth heads, by what they measure: those of the frames, and that of the live run, which has no amplitudes.
HEADS = {"radial distance and amplitude": "tof", "z": "structured_light"}
LIVE_HEAD = "structured_light"

_PERCENTILES = (50, 95)


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        frames: of each recording that one process takes.
        live_s: time that the service is observed [s]; 0 for not at all.
    """

    frames: int = 300
    live_s: float = 60.0


QUICK = Settings(frames=15, live_s=0.0)


def run(settings: Settings, context: Context) -> Findings:
    """Records, takes the frames in one process, and runs the service.

    Raises:
        UnavailableError: the disk has no room for the recordings.
    """
    with tempfile.TemporaryDirectory(prefix="abs-budget-") as name:
        folder = Path(name)
        _check_room(folder, settings)
        measured = {what: _frames(folder, head, settings, context) for what, head in HEADS.items()}
        goals = [goal for what, passes in measured.items() for goal in _frame_goals(what, passes[0])]
        sections = [Section(f"Budget of a frame: {what}", (_budget(passes),)) for what, passes in measured.items()]
        values = {HEADS[what]: _values(passes) for what, passes in measured.items()}
        if settings.live_s:
            seen = _live(folder, settings, context)
            goals += _live_goals(seen)
            sections.append(Section("The service with the recording as its device", (_processes(seen),)))
            values["live"] = {"cores": seen.cores, "lost": seen.lost, "tracking": seen.tracking}
    return Findings(tuple(goals), tuple(sections), values)


def _check_room(folder: Path, settings: Settings) -> None:
    needed = EXPOSURE_BYTES * max(settings.frames, 2 * _exposures(settings.live_s))
    free = shutil.disk_usage(folder).free
    if needed > free:
        raise UnavailableError(
            f"{folder.parent}: {free / 1e9:.1f} GB are free, the recordings need {needed / 1e9:.1f} GB; make room, or "
            "name another folder for temporary files with TMPDIR"
        )


def _exposures(live_s: float) -> int:
    """Exposures of a recording that outlasts the observed time."""
    return round((live_s + 2 * live.SETTLE_S) * RATE_HZ) if live_s else 0


def _frames(folder: Path, head: str, settings: Settings, context: Context) -> tuple[Pass, Pass]:
    """A pass for the time of the frames, and one for that of the stages."""
    take = folder / "take.mcap"
    write_take(take, head, context.seed + 1, settings.frames, context.progress)
    context.progress(f"{head}: frames")
    offline.run_through(take, is_watched=False)  # compiles what is not in the cache
    passes = offline.run_through(take, is_watched=False), offline.run_through(take, is_watched=True)
    take.unlink()
    return passes


def _live(folder: Path, settings: Settings, context: Context) -> Observed:
    take = folder / "take.mcap"
    write_take(take, LIVE_HEAD, context.seed + 1, _exposures(settings.live_s), context.progress)
    return live.observe(take, LIVE_HEAD, settings.live_s, context.progress)


def _frame_goals(what: str, frames: Pass) -> tuple[Goal, Goal]:
    median, p95 = np.percentile(frames.frame_ms, _PERCENTILES)
    return (
        at_most(f"Time of a frame ({what}), median", median, MEDIAN_MS, "ms"),
        at_most(f"Time of a frame ({what}), 95th percentile", p95, P95_MS, "ms"),
    )


def _live_goals(seen: Observed) -> tuple[Goal, ...]:
    p50, p99 = np.percentile(seen.ages_ms, (50, 99)) if len(seen.ages_ms) else (np.nan, np.nan)
    tracker = sum(cores for name, cores in seen.cores.items() if name == "track")
    return (
        at_most("Frame sets passed over", seen.skipped, 0),
        at_most("Age at publication, p50", p50, AGE_P50_MS, "ms"),
        at_most("Age at publication, p99", p99, AGE_P99_MS, "ms"),
        at_most("The tracker's process", tracker, TRACKER_CORES, "cores"),
        at_most("All processes", sum(seen.cores.values()), ALL_CORES, "cores"),
    )


def _budget(passes: tuple[Pass, Pass]) -> Table:
    """CPU time of the stages of a frame, their share of all stages, and the reference."""
    cpu_ms = passes[1].cpu_ms
    total = np.sum([cpu_ms[stage] for stage in STAGES if stage in cpu_ms], axis=0)
    listed = {stage: cpu_ms[stage] for stage in STAGES if stage in cpu_ms}
    listed |= {
        "all stages": total,
        "beside it: read the file": cpu_ms[READ],
        "reference: copy the images": cpu_ms[COPY],
    }
    rows = tuple(
        (stage, *np.percentile(one, _PERCENTILES).tolist(), 100 * float(one.sum() / total.sum()))
        for stage, one in listed.items()
    )
    columns = (
        Column("stage"),
        *(Column(f"p{p}, CPU", "ms", ".2f") for p in _PERCENTILES),
        Column("share", "%", ".1f"),
    )
    return Table("Stages of single frames", columns, rows)


def _values(passes: tuple[Pass, Pass]) -> dict[str, object]:
    frames, watched = passes
    return {
        "median_ms": float(np.median(frames.frame_ms)),
        "p95_ms": float(np.percentile(frames.frame_ms, 95)),
        "tracking": frames.tracking,
        "thetas": frames.thetas,
        "thetas_watched": watched.thetas,
        "cpu_ms": {stage: np.percentile(one, _PERCENTILES).tolist() for stage, one in watched.cpu_ms.items()},
    }


def _processes(seen: Observed) -> Table:
    rows = tuple((name, 100 * cores) for name, cores in seen.cores.items())
    return Table("Processes", (Column("process"), Column("processor", "% of a core", ".1f")), rows)
