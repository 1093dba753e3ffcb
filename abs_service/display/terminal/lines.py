"""Displays for output that is no terminal: one line a second for people, one JSON object per estimate for scripts."""

import json
from contextlib import suppress
from typing import Self, TextIO

from abs_service.supervision.rig_view import RigView, size
from abs_service.tracking.log.tracker_log import EstimateReport

PERIOD_NS = 1_000_000_000


class _Lines:
    """Lines of an output whose disk may be full: what cannot be written is counted, and the rig goes on."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._lost, self._error = 0, ""

    def write(self, *lines: str) -> None:
        """Writes lines; raises BrokenPipeError if the reader is gone."""
        try:
            print(*lines, sep="\n", file=self._out, flush=True)
        except BrokenPipeError:
            raise
        except OSError as error:
            self._lost, self._error = self._lost + len(lines), error.strerror

    def losses(self) -> list[str]:
        """Says what was lost; empty if nothing was."""
        return [f"up to {self._lost} lines of output are missing: {self._error}"] if self._lost else []


def _note(text: str, notes: TextIO) -> None:
    # Notes come from the log, too, and from the threads that read what children say: none of them may end by it.
    with suppress(OSError):
        print(text, file=notes, flush=True)


class PlainDisplay:
    """One line a second.

    Args:
        out: where the lines go.
        notes: where notes go.
    """

    def __init__(self, out: TextIO, notes: TextIO) -> None:
        self._out = _Lines(out)
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
        self._out.write(line(view))

    def estimate(self, report: EstimateReport) -> None:
        """Lines show the last estimate only."""

    def note(self, text: str) -> None:
        """See `Display`."""
        _note(text, self._notes)

    def close(self, view: RigView) -> None:
        """See `Display`."""
        self._out.write(*view.summary())
        for loss in self._out.losses():
            self.note(loss)


class JsonDisplay:
    """One JSON object per estimate and line, flushed; everything else goes to the notes.

    Args:
        out: where the estimates go.
        notes: where notes and the summary go.
    """

    def __init__(self, out: TextIO, notes: TextIO) -> None:
        self._out = _Lines(out)
        self._notes = notes

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Nothing to restore."""

    def update(self, view: RigView) -> None:
        """Only estimates are printed."""

    def estimate(self, report: EstimateReport) -> None:
        """See `Display`."""
        self._out.write(json.dumps(report.as_dict(), ensure_ascii=False))

    def note(self, text: str) -> None:
        """See `Display`."""
        _note(text, self._notes)

    def close(self, view: RigView) -> None:
        """See `Display`."""
        self.note("\n".join([*view.summary(), *self._out.losses()]))


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
