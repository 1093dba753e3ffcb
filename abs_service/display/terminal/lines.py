"""Displays for output that is no terminal: one line a second for people, one JSON object per estimate for scripts."""

import json
from contextlib import suppress

from abs_service.display.terminal.output import Output
from abs_service.supervision.display import Display
from abs_service.supervision.health.rig_view import RigView, size
from abs_service.tracking.log.tracker_log import EstimateReport

PERIOD_NS = 1_000_000_000


def _note(text: str, notes: Output) -> None:
    # Notes come from the log, too, and from the threads that read what children say: none of them may end by it.
    with suppress(OSError):
        notes.write(f"{text}\n")


class PlainDisplay(Display):
    """One line a second."""

    def __init__(self, out: Output, notes: Output) -> None:
        self._out = out
        self._notes = notes
        self._next_ns = 0

    def update(self, view: RigView) -> None:
        """See `Display`."""
        if view.now_ns < self._next_ns:
            return
        self._next_ns = view.now_ns + PERIOD_NS
        self._out.write(f"{line(view)}\n")

    def note(self, text: str) -> None:
        """See `Display`."""
        _note(text, self._notes)

    def close(self, view: RigView) -> int:
        """See `Display`."""
        self._out.write("\n".join([*view.summary(), ""]))
        if missing := self._out.finish():
            self.note(missing)
        return self._out.lost


class JsonDisplay(Display):
    """One JSON object per estimate and line, flushed; everything else goes to the notes."""

    def __init__(self, out: Output, notes: Output) -> None:
        self._out = out
        self._notes = notes

    def estimate(self, report: EstimateReport) -> None:
        """See `Display`."""
        self._out.write(f"{json.dumps(report.as_dict(), ensure_ascii=False)}\n")

    def note(self, text: str) -> None:
        """See `Display`."""
        _note(text, self._notes)

    def close(self, view: RigView) -> int:
        """See `Display`."""
        missing = self._out.finish()
        self.note("\n".join([*view.summary(), *([missing] if missing else [])]))
        return self._out.lost


def line(view: RigView) -> str:
    """State of the rig in one line."""
    parts = [f"{view.elapsed_s:6.1f} s"]
    parts += [f"{stream.name} {stream.rate_hz:.1f} Hz" for stream in view.streams]
    for name, tracker in view.live.trackers.items():
        if (last := tracker.last) is None:
            continue
        if silence := view.silent.get(name):
            parts.append(f"{name} {silence}, {tracker.estimates} estimates")
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
