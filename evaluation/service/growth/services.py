"""Cost of the service by trackers, and rigs side by side on this host, as many as the laws say that it carries."""

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from abs_service.report.content import Column, Picture, Section, Table
from evaluation.experiment import Goal, at_most
from evaluation.service.frame_budget import live
from evaluation.service.frame_budget.live import Observed, Run
from evaluation.service.frame_budget.rig import write_take
from evaluation.service.growth import hosts
from evaluation.service.growth.hosts import LOAD, Costs
from evaluation.service.growth.laws import fit

#: The depth head of the rigs.
HEAD = "structured_light"

#: Rate of the recording that counts trackers, as a share of its own, so that they keep up.
SPEED = 0.1

#: Bounds for rigs side by side: frame sets passed over, as a share of all; cores by those of the laws.
PASSED_OVER, MORE_CORES = 0.01, 1.2

_COMMANDS = ("run", "capture", "track", "record")


@dataclass(frozen=True, slots=True, eq=False)
class Services:
    """Measured costs of services.

    Attributes:
        by_trackers: processor time of an exposure [ms] by process, for every number of trackers.
        costs: laws of an exposure.
        beside: every one of the rigs side by side.
    """

    by_trackers: Mapping[int, Mapping[str, float]]
    costs: Costs
    beside: Sequence[Observed]


def measure(trackers: Sequence[int], duration_s: float, seed: int, progress: Callable[[str], None]) -> Services:
    """Runs the service with every number of trackers, then as many rigs as this host carries by the laws.

    Args:
        trackers: numbers of trackers, at least three.
        duration_s: time that each run is observed [s].
        seed: of the recording that is played.
        progress: called with the current step.
    """
    slow = {n: Run(f"{n} trackers", duration_s, SPEED, trackers=n) for n in trackers}
    with tempfile.TemporaryDirectory(prefix="abs-growth-") as name:
        take = Path(name) / "take.mcap"
        write_take(take, HEAD, seed, Run("", duration_s).exposures, progress)
        seen = {number: live.observe(take, HEAD, one, progress) for number, one in slow.items()}
        by_trackers = {
            number: {command: 1e3 * cores / slow[number].rate_hz for command, cores in one.cores.items()}
            for number, one in seen.items()
        }
        costs = costs_of(by_trackers)
        return Services(by_trackers, costs, _side_by_side(take, _carried(costs), duration_s, progress))


def goals(services: Services) -> list[Goal]:
    """Goals on the rigs side by side: what is passed over, what nobody counts, and the cores of all."""
    seen = services.beside
    name = f"{len(seen)} rigs on {os.cpu_count()} cores"
    sets = sum(len(one.ages_ms) + one.skipped for one in seen)
    passed_over = sum(one.skipped for one in seen) / sets if sets else np.nan
    cores = sum(one.all_cores for one in seen) / (len(seen) * services.costs.cores(1))
    return [
        at_most(f"{name}: frame sets passed over", 100 * passed_over, 100 * PASSED_OVER, "%"),
        at_most(f"{name}: exposures in no estimate that nobody counted", sum(one.silent for one in seen), 0),
        at_most(f"{name}: their cores, by those of the laws", cores, MORE_CORES),
    ]


def sections(services: Services, drawn: Picture) -> list[Section]:
    """Tables of the trackers, with a picture of their law, of larger set-ups, and of the rigs side by side."""
    columns = (Column("trackers", format=".0f"), *(Column(command, "ms", ".2f") for command in _COMMANDS))
    rows = tuple((n, *(one.get(command, np.nan) for command in _COMMANDS)) for n, one in services.by_trackers.items())
    about = "Depth of 640 × 480, colour of 1280 × 720 pixels, recorded; 600 vertices, 6 × 6 control points each."
    carried = f"As many as the laws say for {LOAD:.0%} of the {os.cpu_count()} cores here; each at 30 Hz, recorded."
    return [
        Section("By trackers", (about, Table("Processor time of an exposure, by process", columns, rows), drawn)),
        Section("Larger set-ups, extrapolated", (hosts.table(services.costs),)),
        Section("Rigs side by side, measured", (carried, _table(services.beside))),
    ]


def values(services: Services) -> dict[str, Any]:
    """Numbers of the services for programs."""
    beside = [
        {"rate_hz": one.rate_hz, "age_ms": one.age_ms, "skipped": one.skipped, "silent": one.silent}
        | {"tracking": one.tracking, "cores": one.all_cores}
        for one in services.beside
    ]
    return {"by_trackers": services.by_trackers, "side_by_side": beside}


def costs_of(by_trackers: Mapping[int, Mapping[str, float]]) -> Costs:
    """Costs of an exposure: the law of `track`, and means of the other processes, by the number of trackers."""
    law = fit(list(by_trackers), [one["track"] for one in by_trackers.values()])
    mean = {name: float(np.mean([one[name] for one in by_trackers.values()])) for name in ("capture", "run", "record")}
    return Costs(mean["capture"], mean["run"], mean["record"], law)


def _carried(costs: Costs) -> int:
    """Rigs with one tracker that this host carries by the laws; one if they are not known."""
    rigs = LOAD * (os.cpu_count() or 1) / costs.cores(1)
    return max(1, int(rigs)) if np.isfinite(rigs) else 1


def _side_by_side(take: Path, rigs: int, duration_s: float, progress: Callable[[str], None]) -> Sequence[Observed]:
    with ThreadPoolExecutor(rigs) as pool:
        observe = partial(live.observe, take, HEAD, progress=progress)
        return tuple(pool.map(observe, [Run(f"rig {k + 1} of {rigs}", duration_s) for k in range(rigs)]))


def _table(beside: Sequence[Observed]) -> Table:
    columns = (
        Column("rig", format=".0f"), Column("estimates", "Hz", ".1f"), Column("age, p50", "ms", ".1f"),
        Column("p99", "ms", ".1f"), Column("passed over", format=".0f"), Column("TRACKING", "", ".1%"),
        Column("cores", format=".2f"),
    )  # fmt: skip
    rows = ((k + 1, one.rate_hz, *one.age_ms, one.skipped, one.tracking, one.all_cores) for k, one in enumerate(beside))
    return Table("Rigs of today on this host", columns, tuple(rows))
