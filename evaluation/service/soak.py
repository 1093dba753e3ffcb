"""Hours of faults: one after the other, at random times, made to one running rig.

Statistic: depth images that were sent more than a second before a fault, or between two, and are in no recording;
faults that no health reported within 2 s; faults after which the rig was not well within half a minute; slopes of each
process's private memory and number of open files, upper ends of their intervals of 95 % confidence.
Goals: none of the first three; the bounds below for the slopes, of runs of ten minutes at least.
Seeds: the context's seed chooses faults and times.
"""

import shutil
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from abs_service.recording.disk import disk_monitor
from abs_service.report.content import Column, Section, Table
from evaluation.experiment import Context, Findings, Goal, UnavailableError, at_most
from evaluation.service.faults import fault, folders, messages, processes
from evaluation.service.faults.fault import Fault, Seen, Try
from evaluation.service.faults.running import RunningRig, start_run
from evaluation.service.live import proc
from evaluation.service.live.trend import trend

TITLE = "Soak: faults at random times, nothing lost, nothing grows"

#: Faults that a rig bears again and again without anybody's help.
FAULTS = tuple(
    one
    for one in (*processes.FAULTS, *folders.FAULTS, *messages.FAULTS)
    if isinstance(one, Fault) and not one.room_mb and "run" not in one.restarted and one.make is not folders.read_only
)
#: The most that a crash may lose [s].
LOST_S = 1.0
#: Data rate of the recordings [bytes/s].
RECORDED_BYTES_S = 11_000_000
#: Bounds of the slopes: memory [MB/min] and open files [1/min]; shortest run in which they can be measured [min].
GROWTH_MB_MIN, GROWTH_FILES_MIN, MIN_DURATION_MIN = 0.3, 0.3, 10.0


@dataclass(frozen=True, slots=True)
class Settings:
    """Duration and rate of faults.

    Attributes:
        minutes: duration [min].
        pause_s: mean time from one recovery to the next fault [s].
    """

    minutes: float = 60.0
    pause_s: float = 15.0


QUICK = Settings(minutes=0.7, pause_s=3.0)


@dataclass(frozen=True, slots=True)
class Usage:
    """Memory and open files of a process at a time, CLOCK_MONOTONIC [ns]."""

    t_ns: int
    process: str
    private_bytes: int
    files: int


def run(settings: Settings, context: Context) -> Findings:
    """Makes faults until the time is over."""
    draw = np.random.default_rng(context.seed)
    made: list[tuple[Fault, Seen]] = []
    usages: list[Usage] = []
    with tempfile.TemporaryDirectory(prefix="abs-soak-") as folder, start_run(Path(folder), "", 0) as rig:
        _check_room(Path(folder), settings.minutes)
        rig.await_calm(fault.PATIENCE_S)
        end_s = time.monotonic() + 60 * settings.minutes
        while time.monotonic() < end_s:
            _watch(rig, min(draw.exponential(settings.pause_s), end_s - time.monotonic()), usages)
            chosen = FAULTS[draw.integers(len(FAULTS))]
            context.progress(f"{len(made)} faults; {(end_s - time.monotonic()) / 60:.1f} min left; {chosen.name}")
            made.append((chosen, fault.make_once(chosen, rig)))
        stamps = rig.recorded_stamps()
        tries = [(one, fault.judge(seen, rig, rig.on_own_clock(stamps))) for one, seen in made]
        lost = lost_images(rig.listener.frames, stamps, [seen for _, seen in made])
    return findings(settings, tries, lost, usages)


def lost_images(frames: Sequence[tuple[int, int, int, int]], stamps: set[int], made: Sequence[Seen]) -> int:
    """Images that are in no recording, though no fault was near.

    Args:
        frames: as in `Listener`.
        stamps: of all recorded images [ns].
        made: the faults.
    """
    near = [(one.made.begin_ns - LOST_S * 1e9, one.calm_ns) for one in made]
    missing = [t_ns for t_ns, _, _, stamp_ns in frames if stamp_ns not in stamps]
    return sum(not any(begin <= t_ns <= end for begin, end in near) for t_ns in missing)


def findings(settings: Settings, tries: Sequence[tuple[Fault, Try]], lost: int, usages: Sequence[Usage]) -> Findings:
    """Goals, and a table with a row for each fault in its order."""
    late = [one for one, seen in tries if np.isfinite(one.noticed_s) and not seen.noticed_s <= fault.NOTICED_S]
    ill = [one for one, seen in tries if np.isnan(seen.recovered_s)]
    slopes = growth(usages) if settings.minutes >= MIN_DURATION_MIN else {}
    goals = (
        at_most(f"Images older than {LOST_S:g} s that are lost", lost, 0),
        at_most(f"Of {len(tries)} faults, those not in health within {fault.NOTICED_S:g} s", len(late), 0),
        at_most("Faults after which the rig was not well in half a minute", len(ill), 0),
        *(goal for name, slope in slopes.items() for goal in _flat(name, slope)),
    )
    columns = (Column("fault"), *(Column(word, "s", ".2f") for word in ("in health", "to recover", "no recording")))
    rows = tuple((one.name, seen.noticed_s, seen.recovered_s, seen.recording_s) for one, seen in tries)
    values = {"faults": len(tries), "late": [one.name for one in late], "growth": slopes, "held": held(usages)}
    return Findings(goals, (Section("Faults", (Table("In their order", columns, rows),)),), values)


def growth(usages: Sequence[Usage]) -> Mapping[str, tuple[float, float]]:
    """Slopes of memory [MB/min] and open files [1/min] of each process: upper ends of their 95 % intervals."""
    found = {}
    for name in sorted({one.process for one in usages}):
        own = [one for one in usages if one.process == name]
        minutes = np.array([one.t_ns for one in own]) / 60e9
        memory = trend(minutes, np.array([one.private_bytes for one in own]) / 1e6)
        files = trend(minutes, np.array([one.files for one in own], np.float64))
        found[name] = (memory.slope + memory.half_width, files.slope + files.half_width)
    return found


def held(usages: Sequence[Usage]) -> Mapping[str, str]:
    """Median memory and number of open files of each process in the first and in the last third, in words."""
    found = {}
    for name in sorted({one.process for one in usages}):
        own = [(one.private_bytes / 1e6, one.files) for one in usages if one.process == name]
        first, last = (np.median(part, axis=0) for part in (own[: len(own) // 3 + 1], own[2 * len(own) // 3 :]))
        found[name] = f"{first[0]:.0f} → {last[0]:.0f} MB, {first[1]:.0f} → {last[1]:.0f} files"
    return found


def _flat(name: str, slope: tuple[float, float]) -> tuple[Goal, Goal]:
    words = f"of {name}, upper end of its 95 % interval"
    return (
        at_most(f"Growth of the memory {words}", slope[0], GROWTH_MB_MIN, "MB/min"),
        at_most(f"Growth of the open files {words}", slope[1], GROWTH_FILES_MIN, "1/min"),
    )


def _check_room(folder: Path, minutes: float) -> None:
    # With less than an hour's room, the recorder warns of a full disk, and no fault ends.
    needed, free = round((minutes * 60 + disk_monitor.WARN_S) * RECORDED_BYTES_S), shutil.disk_usage(folder).free
    if needed > free:
        raise UnavailableError(
            f"{folder.parent}: {free / 1e9:.1f} GB are free, the recordings need {needed / 1e9:.1f} GB; make room, or "
            "name another folder for temporary files with TMPDIR"
        )


def _watch(rig: RunningRig, seconds: float, usages: list[Usage]) -> None:
    """Notes once a second what the processes hold."""
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        for name, pid in rig.processes().items():
            files = len(list(Path(f"/proc/{pid}/fd").iterdir()))
            usages.append(Usage(rig.now_ns(), name, proc.usage(pid).private_bytes, files))
        time.sleep(max(0.0, min(1.0, end_s - time.monotonic())))
