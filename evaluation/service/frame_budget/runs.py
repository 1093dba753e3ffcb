"""Runs of the service on a recording: alone, beside a busy program, with two cameras, and at higher rates."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from abs_service.report.content import Column, Section, Table
from evaluation.experiment import Goal, at_least, at_most
from evaluation.service.frame_budget.errors import TrackedFrame, Truth, vertex_errors
from evaluation.service.frame_budget.live import Observed, Run

ALONE, BUSY, TWO, FAST = "alone", "beside one busy process", "two cameras", ("60 Hz", "90 Hz")

#: Bounds of the goals: ages, and cores.
AGE_P50_MS, AGE_P99_MS, TRACKER_CORES, ALL_CORES = 20.0, 50.0, 0.35, 1.2

#: The least rate with two cameras; of higher rates, the least share; and how much larger live errors may be.
TWO_HZ, FAST_SHARE, ERROR_RATIO = 20.0, 0.95, 1.05


def runs(live_s: float, beside_s: float) -> tuple[Run, ...]:
    """The runs that are made.

    Args:
        live_s: observed time of the first [s].
        beside_s: of the others, at the recording's own speed [s].
    """
    beside = (
        Run(BUSY, beside_s, busy=1),
        Run(TWO, beside_s, cameras=2),
        *(Run(name, beside_s / speed, speed) for name, speed in zip(FAST, (2.0, 3.0))),
    )
    return (Run(ALONE, live_s), *(beside if beside_s else ()))


def goals(seen: Mapping[str, Observed], replay: Mapping[int, TrackedFrame], truth: Truth) -> list[Goal]:
    """Goals of the runs, compared with a replay of the same recording."""
    found = _alone(seen[ALONE], replay, truth)
    if BUSY in seen:
        late = sum(not one.is_tracking and replay[k].is_tracking for k, one in seen[BUSY].frames.items() if k in replay)
        found.append(at_most(f"Frames that are not TRACKING {BUSY}, and are in the replay", late, 0))
    if TWO in seen:
        found.append(at_least("Estimates with two cameras", seen[TWO].rate_hz, TWO_HZ, "Hz"))
    for name in FAST:
        if name in seen:
            least = FAST_SHARE * float(name.partition(" ")[0])
            found.append(at_least(f"Estimates with one camera at {name}", seen[name].rate_hz, least, "Hz"))
    silent = sum(one.silent for one in seen.values())
    return [*found, at_most("Exposures in no estimate that no component counted, all runs", silent, 0)]


def _alone(seen: Observed, replay: Mapping[int, TrackedFrame], truth: Truth) -> list[Goal]:
    p50, p99 = seen.age_ms
    live_mm, replay_mm = vertex_errors(seen.frames, truth), vertex_errors(replay, truth)
    both = sorted(live_mm.keys() & replay_mm.keys())
    ratio = np.mean([live_mm[k] for k in both]) / np.mean([replay_mm[k] for k in both]) if both else np.nan
    return [
        at_most("Frame sets passed over", seen.skipped, 0),
        at_most("Age at publication, p50", p50, AGE_P50_MS, "ms"),
        at_most("Age at publication, p99", p99, AGE_P99_MS, "ms"),
        at_most("The tracker's process", seen.cores.get("track", np.nan), TRACKER_CORES, "cores"),
        at_most("All processes", seen.all_cores, ALL_CORES, "cores"),
        at_most("Mean vertex error live, by that of the replay of the same exposures", float(ratio), ERROR_RATIO),
    ]


def section(seen: Mapping[str, Observed]) -> Section:
    """The table of the runs."""
    columns = (
        Column("run"), Column("estimates", "Hz", ".1f"), Column("age, p50", "ms", ".1f"), Column("p99", "ms", ".1f"),
        Column("passed over"), Column("in no estimate"), Column("of these counted by nobody"),
        Column("TRACKING", "", ".1%"), Column("run", "% of a core", ".0f"), Column("capture", "% of a core", ".0f"),
        Column("track", "% of a core", ".0f"), Column("record", "% of a core", ".0f"),
    )  # fmt: skip
    rows = tuple(
        (
            name, one.rate_hz, *one.age_ms, one.skipped, one.lost, one.silent, one.tracking,
            *(100 * one.cores.get(command, 0.0) for command in ("run", "capture", "track", "record")),
        )
        for name, one in seen.items()
    )  # fmt: skip
    return Section("The service with the recording as its device", (Table("Runs", columns, rows),))


def values(seen: Mapping[str, Observed]) -> dict[str, Any]:
    """Numbers of the runs for programs."""
    return {
        name: {
            "rate_hz": one.rate_hz,
            "age_ms": one.age_ms,
            "skipped": one.skipped,
            "lost": one.lost,
            "silent": one.silent,
            "tracking": one.tracking,
            "cores": dict(one.cores),
        }
        for name, one in seen.items()
    }
