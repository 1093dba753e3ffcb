"""Pictures of an observed run."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from abs_service.report import plots
from evaluation.service.live.measurement import ObservedRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Ages are drawn over time as percentiles of so many seconds.
SPAN_S = 5.0


def ages(seen: ObservedRun, arrived_ms: NDArray[np.float64], goals_ms: Mapping[str, float]) -> "Figure":
    """Age of the estimates on arrival: over time, and as a histogram.

    Args:
        seen: the run.
        arrived_ms: age of each of its arrivals (n,) [ms].
        goals_ms: bounds by the name of the percentile [ms].
    """
    figure = plots.figure(9, 3.4)
    over_time, histogram = figure.subplots(1, 2, width_ratios=(2, 1), sharey=True)
    times_s = np.array([one.exposed_ns - seen.begin_ns for one in seen.arrivals]) * 1e-9
    span = np.floor(times_s / SPAN_S)
    for percentile, color in ((99, "tab:orange"), (50, "tab:blue")):
        values = [np.percentile(arrived_ms[span == k], percentile) for k in np.unique(span)]
        over_time.plot((np.unique(span) + 0.5) * SPAN_S, values, color=color, label=f"p{percentile} of {SPAN_S:g} s")
    over_time.plot(times_s, arrived_ms, ",", color="0.6", zorder=0)
    histogram.hist(arrived_ms, bins=100, orientation="horizontal", color="tab:blue")
    for name, goal_ms in goals_ms.items():
        for axes in (over_time, histogram):
            axes.axhline(goal_ms, color="tab:red", linewidth=0.8, linestyle=":")
        over_time.annotate(f"goal {name}", (0, goal_ms), color="tab:red", fontsize="small", va="bottom")
    over_time.set(xlabel="time [s]", ylabel="age on arrival [ms]", ylim=(0, None))
    histogram.set(xlabel="estimates")
    over_time.legend(loc="upper right", fontsize="small")
    return figure


def memory(seen: ObservedRun) -> "Figure":
    """Growth of each process's resident memory over time."""
    figure = plots.figure(9, 3.4)
    axes = figure.subplots()
    for name, usages in seen.usages.items():
        held = np.array([one.resident_bytes for one in usages]) * 1e-6
        axes.plot(seen.times_s / 60, held - held[0], label=f"{name}: {held[0]:.0f} MB at first")
    axes.set(xlabel="time [min]", ylabel="growth of the resident memory [MB]")
    axes.legend(fontsize="small")
    return figure


def cpu(seen: ObservedRun) -> "Figure":
    """Share of a core that each process uses, over time."""
    figure = plots.figure(9, 3.0)
    mean, over_time = figure.subplots(1, 2, width_ratios=(1, 2), sharey=True)
    middle = (seen.times_s[1:] + seen.times_s[:-1]) / 2
    for name, usages in seen.usages.items():
        used_s = np.array([one.cpu_s for one in usages])
        bar = mean.bar(name, 100 * (used_s[-1] - used_s[0]) / (seen.times_s[-1] - seen.times_s[0]))
        mean.bar_label(bar, fmt="%.0f %%")
        over_time.plot(middle, 100 * np.diff(used_s) / np.diff(seen.times_s), linewidth=0.8, label=name)
    mean.set(ylabel="share of a core [%]", ylim=(0, None))
    over_time.set(xlabel="time [s]")
    return figure
