"""Tables of an observed run."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from abs_service.bus import keys
from abs_service.report.content import Column, Table
from evaluation.service.live.losses import exposures
from evaluation.service.live.measurement import ObservedRun, StartTimes
from evaluation.service.live.rig import STREAMS
from evaluation.service.live.trend import Trend

_PERCENTILES = (50, 90, 99)


def ages(numbers_ms: Mapping[str, NDArray[np.float64]]) -> Table:
    """Percentiles of the ages of all estimates, (n,) each [ms], by name."""
    columns = (Column("from the exposure to"), *(Column(f"p{p}", "ms", ".1f") for p in _PERCENTILES))
    rows = tuple(
        (name, *(float(np.percentile(one, p)) for p in _PERCENTILES), float(one.max()))
        for name, one in numbers_ms.items()
    )
    return Table("Age of the estimates", (*columns, Column("largest", "ms", ".1f")), rows)


def frames(seen: ObservedRun) -> Table:
    """Number of the exposures between the first and the last observed estimate that were used and recorded."""
    rows: list[tuple[str | float, ...]] = []
    for sensor, stream in STREAMS:
        exposed = exposures(seen, sensor)
        used = {one.sensors[sensor] for one in seen.arrivals if sensor in one.sensors}
        recorded = seen.recorded[keys.image(sensor, stream)].intersection(exposed)
        rows.append((f"{sensor}/{stream}", len(exposed), len(used), len(recorded)))
    columns = (Column(name, format=".0f") for name in ("stream", "exposures", "in an estimate", "recorded"))
    return Table("Where the frames went", tuple(columns), tuple(rows))


def losses(watched: Mapping[str, int], whole: Mapping[str, int]) -> Table:
    """Losses counted by the components, by component and cause.

    Args:
        watched: in the observed time.
        whole: from the start on; initial detection skips frames.
    """
    rows = tuple((name, watched.get(name, 0), whole[name]) for name in sorted(whole))
    columns = (Column("component: what"), Column("observed", format=".0f"), Column("from the start", format=".0f"))
    return Table("What the components counted as lost", columns, rows or (("nothing", 0, 0),))


def processes(seen: ObservedRun, growth: Mapping[str, Trend], growth_from_s: float) -> Table:
    """CPU time and memory of every process.

    Args:
        seen: the run.
        growth: of the resident memory of each [MB/min].
        growth_from_s: since when [s].
    """
    columns = (
        Column("process"),
        Column("processor", "% of a core", ".1f"),
        Column("memory at the end", "MB", ".0f"),
        Column("of this its own", "MB", ".0f"),
        Column(f"growth after {growth_from_s:.0f} s", "MB/min", "+.2f"),
        Column("± (95 %)", "MB/min", ".2f"),
    )
    rows: list[tuple[str | float, ...]] = []
    for name, usages in seen.usages.items():
        share = (usages[-1].cpu_s - usages[0].cpu_s) / (seen.times_s[-1] - seen.times_s[0])
        held = usages[-1].resident_bytes * 1e-6, usages[-1].private_bytes * 1e-6
        rows.append((name, float(100 * share), *held, growth[name].slope, growth[name].half_width))
    return Table("Processes", columns, tuple(rows))


def machine(seen: ObservedRun) -> Table:
    """CPU time of the machine, on average and in the busiest sampling interval."""
    took_s = np.diff(seen.times_s)
    busy, stolen = (
        100 * np.diff([getattr(one, name) for one in seen.machine]) / took_s for name in ("busy_s", "stolen_s")
    )
    own_s = np.sum([[one.cpu_s for one in usages] for usages in seen.usages.values()], axis=0)
    own = 100 * np.diff(own_s) / took_s
    rows = tuple(
        (name, float(np.average(one, weights=took_s)), float(one.max()))
        for name, one in {
            "the service": own,
            "all others, this program included": busy - own,
            "taken by the host (steal)": stolen,
        }.items()
    )
    columns = Column("for"), Column("average", "% of a core", ".1f"), Column("most", "% of a core", ".1f")
    return Table("All processors of the machine", columns, rows)


def starts(starts: Sequence[StartTimes], cold: Sequence[StartTimes], help_s: Sequence[float]) -> Table:
    """Times from a command to its first effect; `cold` are starts with an empty cache of kernels."""
    numbers_s = {
        "start to the first estimate": [one.first_s for one in starts],
        "start to the first TRACKING": [one.tracking_s for one in starts],
        "empty cache, to the first estimate": [one.first_s for one in cold],
        "empty cache, to the first TRACKING": [one.tracking_s for one in cold],
        "--help": list(help_s),
    }
    columns = (
        Column("what"),
        Column("times"),
        *(Column(name, "s", ".2f") for name in ("quickest", "median", "slowest")),
    )
    rows = tuple(
        (name, float(len(some)), min(some), float(np.median(some)), max(some))
        for name, some in numbers_s.items()
        if some
    )
    return Table("From the command to its first effect", columns, rows)
