"""Displays for output that is no terminal: one line a second for people, one JSON object per estimate for scripts."""

import json
from typing import Self, TextIO

from abs_service.supervision.rig_view import RigView, size
from abs_service.tracking.log.tracker_log import EstimateReport

PERIOD_NS = 1_000_000_000


class PlainDisplay:
    """One line a second.

    Args:
        out: where the lines go.
        notes: where notes go.
    """

    def __init__(self, out: TextIO, notes: TextIO) -> None:
        self._out = out
        self._notes = notes
        self._next_ns = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Nothing to restore."""

    def update(self, view: RigView) -> None:
        """See `Display`."""
        if view.now_ns < self._next_ns:
            return
        self._next_ns = view.now_ns + PERIOD_NS
        print(line(view), file=self._out, flush=True)

    def estimate(self, report: EstimateReport) -> None:
        """Lines show the last estimate only."""

    def note(self, text: str) -> None:
        """See `Display`."""
        print(text, file=self._notes, flush=True)

    def close(self, view: RigView) -> None:
        """See `Display`."""
        print(*view.summary(), sep="\n", file=self._out, flush=True)


class JsonDisplay:
    """One JSON object per estimate and line, flushed; everything else goes to the notes.

    Args:
        out: where the estimates go.
        notes: where notes and the summary go.
    """

    def __init__(self, out: TextIO, notes: TextIO) -> None:
        self._out = out
        self._notes = notes

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Nothing to restore."""

    def update(self, view: RigView) -> None:
        """Only estimates are printed."""

    def estimate(self, report: EstimateReport) -> None:
        """See `Display`."""
        print(json.dumps(report.as_dict(), ensure_ascii=False), file=self._out, flush=True)

    def note(self, text: str) -> None:
        """See `Display`."""
        print(text, file=self._notes, flush=True)

    def close(self, view: RigView) -> None:
        """See `Display`."""
        print(*view.summary(), sep="\n", file=self._notes, flush=True)


def line(view: RigView) -> str:
    """State of the rig in one line."""
    parts = [f"{view.elapsed_s:6.1f} s"]
    parts += [f"{stream.name} {stream.rate_hz:.1f} Hz" for stream in view.streams]
    for name, tracker in view.live.trackers.items():
        if (last := tracker.last) is None:
            continue
        error = "" if last.error_mm is None else f" error {last.error_mm:.2f} mm, surface {last.surface_mm:.2f} mm,"
        reasons = f" ({'; '.join(last.reasons)})" if last.reasons else ""
        parts.append(f"{name} {last.status}{reasons}{error} {last.solve_ms:.1f} ms, {tracker.estimates} estimates")
    if recording := view.recording:
        forecast = f", {recording.forecast}" if recording.forecast else ""
        parts.append(f"{recording.file.name} {size(recording.size)}, {recording.dropped} dropped{forecast}")
    parts += [f"recording: {view.recording_remark}"] if view.recording_remark else []
    parts += [f"{component}: {message}" for component, _, message in view.troubles]
    return " | ".join([*parts, view.activity] if view.activity else parts)
