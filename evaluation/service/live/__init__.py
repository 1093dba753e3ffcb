"""The service from end to end, started as by a user and observed from outside.

Observed are the messages on the bus, the operating system's statistics and the finished recording.

Statistic: losses; percentiles of the ages of all estimates; the slope of each process's memory, with its interval of
95 % confidence; median time from the start to the first TRACKING, with the kernels in the cache and with an empty one;
median time of `--help`.
Goals: no loss; the bounds below. Memory meets its goal if the interval's upper end is below the bound: what cannot be
told from growth is missed. Until 2026-11-23 it was the lower end, which a noisy measurement always met. Until
2026-11-25 start and help were the quickest of several, with bounds of 5 and 0.5 s that 2.4 and 0.06 s met, and no start
was cold.
Seeds: one run with the context's seed.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.report.content import Picture, Section, drawing
from evaluation.experiment import Context, Findings, Goal, at_most
from evaluation.service.live import losses, measurement, pictures, tables
from evaluation.service.live.measurement import ObservedRun, StartTimes
from evaluation.service.live.trend import Trend, rolling_minimum, trend

TITLE = "End to end: losses, ages, processors, memory and start"

#: Bounds of the goals: median and 99th percentile of the age [ms], growth of memory [MB/min].
P50_MS, P99_MS, GROWTH_MB_MIN = 40.0, 66.0, 0.3

#: Those of the start with kernels in the cache and with an empty cache, and of help [s].
START_S, COLD_START_S, HELP_S = 2.0, 15.0, 0.1

#: The recorder holds the index of a file until the next one begins, at this rate after two minutes; with a margin [s].
FILE_S = 150.0

#: Minimum time for estimating growth per minute [s].
MIN_S = 120.0


@dataclass(frozen=True, slots=True)
class Settings:
    """Durations and repetitions.

    Attributes:
        starts: number of starts that are timed; each warms the caches for the next.
        cold_starts: number of starts that are timed with an empty cache of kernels.
        help_runs: number of timed runs of `--help`.
        settle_s: time after the first TRACKING that is not observed [s].
        duration_s: observed time [s].
        warm_up_s: time at its beginning in which memory may still grow [s].
        sample_s: sampling interval of CPU time and memory [s].
    """

    starts: int = 3
    cold_starts: int = 1
    help_runs: int = 5
    settle_s: float = 5.0
    duration_s: float = 600.0
    warm_up_s: float = FILE_S
    sample_s: float = 1.0


QUICK = Settings(starts=0, cold_starts=0, help_runs=2, settle_s=2.0, duration_s=12.0, warm_up_s=4.0, sample_s=0.25)


def run(settings: Settings, context: Context) -> Findings:
    """Times the start of the service a few times, then observes a run."""
    help_s = measurement.help_s(settings.help_runs)
    starts: list[StartTimes] = []
    for number in range(settings.starts):
        context.progress(f"start {number + 1} of {settings.starts}")
        starts.append(measurement.started(context.seed))
    cold: list[StartTimes] = []
    for number in range(settings.cold_starts):
        context.progress(f"cold start {number + 1} of {settings.cold_starts}")
        cold.append(measurement.started_cold(context.seed))
    seen = measurement.watched(
        context.seed, settings.settle_s, settings.duration_s, settings.sample_s, context.progress
    )
    return findings(settings, help_s, (*starts, seen.start), cold, seen)


def findings(
    settings: Settings,
    help_s: Sequence[float],
    starts: Sequence[StartTimes],
    cold: Sequence[StartTimes],
    seen: ObservedRun,
) -> Findings:
    """Findings of all measurements.

    Args:
        settings: how long was watched.
        help_s: durations of `--help` [s].
        starts: times of each start with the kernels in the cache.
        cold: those of each with an empty cache.
        seen: the observed run.
    """
    published_ms = np.array([one.age_ms for one in seen.arrivals])
    arrived_ms = np.array([one.t_ns - one.exposed_ns for one in seen.arrivals]) * 1e-6
    growth = {name: _growth(seen, name, settings.warm_up_s) for name in seen.usages}
    before, whole = losses.loss_counters(seen.counted_before), losses.loss_counters(seen.counted)
    goals = (
        *_complete(seen, whole - before),
        at_most("Age at publication, p50", float(np.percentile(published_ms, 50)), P50_MS, "ms"),
        at_most("Age at publication, p99", float(np.percentile(published_ms, 99)), P99_MS, "ms"),
        *start_goals(help_s, starts, cold),
        *(memory_goal(name, one) for name, one in growth.items() if settings.duration_s - settings.warm_up_s >= MIN_S),
    )
    ages_ms = {"publication": published_ms, "arrival at the subscriber": arrived_ms}
    wanted_ms = {"p50": P50_MS, "p99": P99_MS}
    sections = (
        Section("Ages", (tables.ages(ages_ms), _drawn_ages(seen, arrived_ms, wanted_ms))),
        Section("Frames", (tables.frames(seen), tables.losses(whole - before, whole))),
        Section(
            "Processes",
            (
                tables.processes(seen, growth, settings.warm_up_s),
                tables.machine(seen),
                _drawn_cpu(seen),
                _drawn_memory(seen),
            ),
        ),
        Section("Start", (tables.starts(starts, cold, help_s),)),
    )
    return Findings(goals, sections, _values(seen, whole - before, whole))


def _complete(seen: ObservedRun, counted: Mapping[str, int]) -> tuple[Goal, ...]:
    """Goals on completeness: no frame and no message is lost."""
    return (
        at_most(f"Of {len(seen.arrivals)} frames, those in no estimate", losses.untracked(seen), 0),
        at_most("Estimates that lack a sensor", losses.partial(seen), 0),
        at_most("Estimates that the subscriber missed", losses.not_received(seen), 0),
        at_most("Messages missing in the recording", sum(losses.unrecorded(seen).values()), 0),
        at_most("Losses that the components counted", sum(counted.values()), 0),
    )


def start_goals(help_s: Sequence[float], starts: Sequence[StartTimes], cold: Sequence[StartTimes]) -> tuple[Goal, ...]:
    """Goals on the time until something is there.

    Args:
        help_s: durations of `--help` [s].
        starts: with the kernels in the cache.
        cold: with an empty cache.
    """

    def tracking_s(some: Sequence[StartTimes]) -> float:
        return float(np.median([one.tracking_s for one in some]))

    warm = at_most("Start to the first TRACKING, kernels in the cache, median", tracking_s(starts), START_S, "s")
    help_goal = at_most("--help, median", float(np.median(help_s)), HELP_S, "s")
    if not cold:
        return warm, help_goal
    return warm, at_most("The same with an empty cache, median", tracking_s(cold), COLD_START_S, "s"), help_goal


def _growth(seen: ObservedRun, process: str, from_s: float) -> Trend:
    """Growth rate of the lower envelope of the resident memory of a process [MB/min]."""
    late = seen.times_s >= from_s
    held = np.array([one.resident_bytes for one in seen.usages[process]])[late] * 1e-6
    samples = round(FILE_S / float(np.mean(np.diff(seen.times_s))))
    return trend(seen.times_s[late] / 60, rolling_minimum(held, samples))


def memory_goal(process: str, growth: Trend) -> Goal:
    """Goal on memory: it grows by no more than is allowed, with 95 % confidence."""
    what = f"Growth of the memory of {process}, upper end of its 95 % interval"
    return at_most(what, growth.slope + growth.half_width, GROWTH_MB_MIN, "MB/min")


def _drawn_ages(seen: ObservedRun, arrived_ms: NDArray[np.float64], wanted_ms: Mapping[str, float]) -> Picture:
    return drawing(
        pictures.ages(seen, arrived_ms, wanted_ms),
        "Age of the estimates on arrival, over time and how often each occurs; grey: every single one.",
        "Two curves of percentiles over time, beside them a histogram; dotted lines mark the goals.",
    )


def _drawn_cpu(seen: ObservedRun) -> Picture:
    return drawing(
        pictures.cpu(seen), "Share of a core, on average and over time.", "A bar and a curve for each process."
    )


def _drawn_memory(seen: ObservedRun) -> Picture:
    return drawing(
        pictures.memory(seen), "Growth of the resident memory since the watch began.", "A curve for each process."
    )


def _values(seen: ObservedRun, counted: Mapping[str, int], from_start: Mapping[str, int]) -> dict[str, Any]:
    return {
        "losses": dict(counted),
        "losses_from_start": dict(from_start),
        "unrecorded": dict(losses.unrecorded(seen)),
        "estimates": len(seen.arrivals),
        "share_tracking": float(np.mean([one.is_tracking for one in seen.arrivals])),
        "recorded_bytes": seen.recorded_bytes,
        "exit_code": seen.exit_code,
        "processors": os.cpu_count(),
    }
