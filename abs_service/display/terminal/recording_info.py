"""Summary of a recording, as tables for people and as values for scripts."""

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
from rich.table import Table

from abs_service.display.terminal import recorded_configuration
from abs_service.display.terminal.console import TableConsole
from abs_service.recording.recovery import is_in_use
from abs_service.recording.summary import Summary, Topic, Track
from abs_service.supervision.health.rig_view import size
from drivers.contract.text import printable


def show(summary: Summary) -> None:
    """Prints the tables."""
    console, found = TableConsole(highlight=False, soft_wrap=True), values(summary)
    unfinished = "still recorded" if is_in_use(summary.path) else "not finished (`abs-service recover` repairs it)"
    state = "" if found["finished"] else f", {unfinished}"
    damage = f", {summary.damaged} damaged parts" if summary.damaged else ""
    time = f"{found['duration_s']:.1f} s from {found['start']}"
    lines = [
        f"{summary.path}: {size(summary.size_bytes)}, {time}{state}{damage}",
        "sensors: " + (", ".join(f"{name} {w} × {h} px" for name, (w, h) in found["sensors"].items()) or "none"),
        f"attached: {', '.join(found['attachments']) or 'no configuration'}",
        *recorded_configuration.lines(found["configuration"]),
        *(f"{name} = {number}" for name, number in found["losses"].items()),
    ]
    for line in lines:
        console.print(line, markup=False)
    console.print(_topics(found["topics"]))
    if found["trackers"]:
        console.print(_trackers(found["trackers"]))


def values(summary: Summary) -> dict[str, Any]:
    """The same as values: SI units, None where a value is unknown."""
    contents = summary.contents
    return {
        "file": str(summary.path),
        "file_bytes": summary.size_bytes,
        "finished": not contents.truncated,
        "damaged": summary.damaged,
        "start": datetime.fromtimestamp(contents.start_ns * 1e-9, UTC).isoformat(timespec="seconds"),
        "duration_s": (contents.end_ns - contents.start_ns) * 1e-9,
        "configuration": recorded_configuration.values(contents),
        "attachments": sorted(map(printable, contents.attachments)),
        "sensors": {printable(name): pixels for name, pixels in sorted(summary.sensors.items())},
        "topics": {printable(name): _topic(topic) for name, topic in sorted(summary.topics.items())},
        "trackers": {printable(name): _track(track) for name, track in sorted(summary.tracks.items())},
        "losses": {printable(name): number for name, number in summary.losses.items()},
    }


def _topic(topic: Topic) -> dict[str, Any]:
    gaps_s = topic.gaps_s
    return {
        "schema": printable(topic.schema),
        "messages": len(topic.times_ns),
        "bytes": topic.size_bytes,
        "rate_hz": _known(topic.rate_hz),
        "gaps": len(gaps_s),
        "longest_gap_s": max(gaps_s, default=0.0),
        "lost": topic.lost,
        "reconnects": topic.reconnects,
    }


def _track(track: Track) -> dict[str, Any]:
    total = track.statuses.total()
    return {
        "estimates": total,
        "shares": {name: number / total for name, number in track.statuses.most_common()},
        "longest_untracked_s": track.untracked_s,
        "deviation_m": _quantiles(track.deviations_m),
        "solve_s": _quantiles([1e-3 * one for one in track.solve_ms]),
        "skipped": track.skipped,
        "meshes": len(track.meshes),
    }


def _quantiles(numbers: Sequence[float]) -> dict[str, float] | None:
    known = [one for one in numbers if math.isfinite(one)]
    if not known:
        return None
    return {"median": float(np.median(known)), "p95": float(np.percentile(known, 95))}


def _known(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _topics(topics: dict[str, Any]) -> Table:
    table = Table("topic", box=None, pad_edge=False)
    for name in ("messages", "rate", "size", "gaps", "longest", "lost"):
        table.add_column(name, justify="right")
    for name, one in topics.items():
        if name.endswith("/info"):
            continue  # in the line of its image
        rate = "" if one["rate_hz"] is None else f"{one['rate_hz']:.1f} Hz"
        longest = f"{one['longest_gap_s']:.2f} s" if one["gaps"] else ""
        info = topics.get(name.removesuffix("image") + "info") if name.endswith("/image") else None
        lost = str(info["lost"]) if info else ""
        table.add_row(name, str(one["messages"]), rate, size(one["bytes"]), str(one["gaps"] or ""), longest, lost)
    return table


def _trackers(trackers: dict[str, Any]) -> Table:
    """A column for each tracker, which fits into a narrow window."""
    table = Table("tracker", *trackers, box=None, pad_edge=False)
    rows = {
        "status": lambda one: ", ".join(f"{share:.1%} {status}" for status, share in one["shares"].items()),
        "longest without TRACKING": lambda one: f"{one['longest_untracked_s']:.1f} s",
        "σ, median (95 %)": lambda one: _words(one["deviation_m"], 1e3, "mm"),
        "search, median (95 %)": lambda one: _words(one["solve_s"], 1e3, "ms"),
        "frame sets skipped": lambda one: str(one["skipped"]),
        "meshes": lambda one: str(one["meshes"]),
    }
    for name, text in rows.items():
        table.add_row(name, *map(text, trackers.values()))
    return table


def _words(found: dict[str, float] | None, factor: float, unit: str) -> str:
    return "" if found is None else f"{factor * found['median']:.2f} ({factor * found['p95']:.2f}) {unit}"
