"""A rig of today on two cores: depth of 640 × 480 and colour of 1280 × 720 pixels, 30 Hz, 600 vertices, NURBS 6 × 6.

The simulated device is recorded first, so that no simulation competes. One process then takes the recording frame by
frame; afterwards it is the live device of the whole service, which records what it publishes: alone, beside a program
that keeps a core busy, as two cameras, and played at 60 and 90 Hz.

Statistic: median and 95th percentile of the times of single frames in one pass, from the pairing of the images to the
bytes of the estimate, without the first five; CPU time of every stage of such a frame in a second pass, in which the
functions at which the stages begin are wrapped (`stages`); beside it, in that pass, the CPU time of a plain copy of
the images. Live: percentiles of the ages at publication, frame sets that were passed over, and CPU time per time of
every process; estimates per second; exposures in no estimate that no component counted; mean vertex error by that of a
replay of the same exposures; exposures that are not TRACKING, and are in the replay. Since 2026-11-30 memory that is
freed is kept, as in the processes of the service; until then the system cleared it for each image anew. Until
2026-11-25 the service ran alone for 60 s, and met all of its goals but the tracker's 0.35 of a core.
Goals: 7 and 10 ms; alone, ages of 20 ms (median) and 50 ms (99th percentile), no set passed over, 0.35 of a core for
the tracker and 1.2 for all processes, and at most 1.05 times the replay's error; beside a busy program, every frame
TRACKING that is so in the replay; two cameras, 20 Hz; at 60 and 90 Hz, 95 % of them; nothing lost silently.
Seeds: one recording of each depth head with the context's seed + 1.

Easier than reality: the sheet covers an eighth of the depth image, recorded cameras need no driver, and two cameras are
one recording twice, from one place and with the same noise.
"""

import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from abs_service.report.content import Column, Section, Table
from abs_service.supervision.process_setup.process_tuning import keep_freed_memory
from drivers.simulated.address import parse
from evaluation.experiment import Context, Findings, Goal, UnavailableError, at_most
from evaluation.service.frame_budget import live, offline, runs
from evaluation.service.frame_budget.live import Observed
from evaluation.service.frame_budget.offline import Pass
from evaluation.service.frame_budget.rig import EXPOSURE_BYTES, KEPT_BYTES, address, write_take
from evaluation.service.frame_budget.stages import COPY, READ, STAGES

TITLE = "A rig of today: where the time of a frame goes"

#: Bounds of the goals for the time of a frame.
MEDIAN_MS, P95_MS = 7.0, 10.0

#: Depth heads, by what they measure: those of the frames, and that of the live run, which has no amplitudes.
HEADS = {"radial distance and amplitude": "tof", "z": "structured_light"}
LIVE_HEAD = "structured_light"

_PERCENTILES = (50, 95)


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        frames: of each recording that one process takes.
        live_s: time that the service is observed alone [s]; 0 for no live run at all.
        beside_s: the same of every other live run, at the recording's own speed [s]; 0 for none.
    """

    frames: int = 300
    live_s: float = 300.0
    beside_s: float = 60.0


QUICK = Settings(frames=15, live_s=0.0, beside_s=0.0)


def run(settings: Settings, context: Context) -> Findings:
    """Records, takes the frames in one process, and runs the service.

    Raises:
        UnavailableError: the disk has no room for the recordings.
    """
    keep_freed_memory()  # as the processes of the service do
    with tempfile.TemporaryDirectory(prefix="abs-budget-") as name:
        folder = Path(name)
        _check_room(folder, settings)
        measured = {what: _frames(folder, head, settings, context) for what, head in HEADS.items()}
        goals = [goal for what, passes in measured.items() for goal in _frame_goals(what, passes[0])]
        sections = [Section(f"Budget of a frame: {what}", (_budget(passes),)) for what, passes in measured.items()]
        values = {HEADS[what]: _values(passes) for what, passes in measured.items()}
        if settings.live_s:
            seen, replay = _live(folder, settings, context)
            simulation = parse(address(LIVE_HEAD, context.seed + 1)).build()
            goals += runs.goals(seen, replay.frames, lambda k: simulation.truths(k)[0].points_r)
            sections.append(runs.section(seen))
            values["live"] = runs.values(seen)
    return Findings(tuple(goals), tuple(sections), values)


def _check_room(folder: Path, settings: Settings) -> None:
    needed = EXPOSURE_BYTES * max(settings.frames, _exposures(settings)) + (KEPT_BYTES if settings.live_s else 0)
    free = shutil.disk_usage(folder).free
    if needed > free:
        raise UnavailableError(
            f"{folder.parent}: {free / 1e9:.1f} GB are free, the recordings need {needed / 1e9:.1f} GB; make room, or "
            "name another folder for temporary files with TMPDIR"
        )


def _exposures(settings: Settings) -> int:
    """Exposures of a recording that outlasts every live run."""
    return max(run.exposures for run in runs.runs(settings.live_s, settings.beside_s))


def _frames(folder: Path, head: str, settings: Settings, context: Context) -> tuple[Pass, Pass]:
    """A pass for the time of the frames, and one for that of the stages."""
    take = folder / "take.mcap"
    write_take(take, head, context.seed + 1, settings.frames, context.progress)
    context.progress(f"{head}: frames")
    offline.run_through(take, is_watched=False)  # compiles what is not in the cache
    passes = offline.run_through(take, is_watched=False), offline.run_through(take, is_watched=True)
    take.unlink()
    return passes


def _live(folder: Path, settings: Settings, context: Context) -> tuple[Mapping[str, Observed], Pass]:
    """The live runs by name, and a pass through their recording."""
    take = folder / "take.mcap"
    write_take(take, LIVE_HEAD, context.seed + 1, _exposures(settings), context.progress)
    context.progress("replay of the live runs' recording")
    replay = offline.run_through(take, is_watched=False)
    made = runs.runs(settings.live_s, settings.beside_s)
    return {run.name: live.observe(take, LIVE_HEAD, run, context.progress) for run in made}, replay


def _frame_goals(what: str, frames: Pass) -> tuple[Goal, Goal]:
    median, p95 = np.percentile(frames.frame_ms, _PERCENTILES)
    return (
        at_most(f"Time of a frame ({what}), median", median, MEDIAN_MS, "ms"),
        at_most(f"Time of a frame ({what}), 95th percentile", p95, P95_MS, "ms"),
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
