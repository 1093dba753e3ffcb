"""The live table in a terminal."""

from contextlib import suppress
from typing import Self

from absmsg.v1.health_pb2 import Health
from rich.console import Console, Group, RenderableType
from rich.live import Live as LiveRegion
from rich.markup import escape
from rich.padding import Padding
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text

from abs_service.display.terminal.output import Output
from abs_service.supervision.children.child import ChildState
from abs_service.supervision.display import Display
from abs_service.supervision.health.rig_view import RigView, size
from abs_service.tracking.log.tracker_log import EstimateReport, TrackerLog

#: Time between two tables [ns].
PERIOD_NS = 160_000_000

#: Colour of each status of an estimate.
STATUS_COLORS = {"TRACKING": "green", "DEGRADED": "yellow", "LOST": "red", "INITIALIZING": "cyan"}
_STATE = {
    ChildState.RUNNING: "green",
    ChildState.FAILED: "red",
    ChildState.STALLED: "red",
    ChildState.BACKOFF: "yellow",
}


class TableDisplay(Display):
    """A table that is redrawn several times a second, below the notes; not while the terminal is halted (Ctrl-S)."""

    def __init__(self, console: Console, output: Output) -> None:
        self._console = console
        self._output = output
        self._spinner = Spinner("dots", style="cyan")
        self._region = LiveRegion(console=console, auto_refresh=False, transient=True)
        self._next_ns = 0

    def __enter__(self) -> Self:
        self._region.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Gives the terminal back, if it is still there."""
        with suppress(OSError):
            self._region.stop()

    def update(self, view: RigView) -> None:
        """See `Display`."""
        if view.now_ns < self._next_ns or not self._output.idle:
            return
        self._next_ns = view.now_ns + PERIOD_NS
        with suppress(OSError):  # the terminal is gone, and the rig goes on
            self._region.update(draw(view, self._spinner), refresh=True)

    def note(self, text: str) -> None:
        """See `Display`."""
        with suppress(OSError):  # the terminal is gone, and the rig goes on
            self._console.print(Text(text, style="dim"))

    def close(self, view: RigView) -> int:
        """See `Display`; leaves the last table in the terminal."""
        with suppress(OSError):
            self._region.stop()
            self._console.print(draw(view, Text("")))
            self._console.print("\n".join(view.summary()), highlight=False, markup=False)
        return 0


def draw(view: RigView, spinner: Spinner | Text) -> RenderableType:
    """The whole table; `spinner` moves while something is waited for."""
    parts: list[RenderableType] = [_head(view), _streams(view)]
    if view.live.trackers:
        parts.append(_trackers(view))
    parts += [_recording(view), _processes(view)]
    parts += [Text(f" {component}: {message}", style=_level(level)) for component, level, message in view.troubles]
    if view.activity and isinstance(spinner, Spinner):
        spinner.update(text=f" {view.activity}")
        parts.append(spinner)
    return Group(*parts)


def _level(level: int) -> str:
    return "red" if level == Health.LEVEL_ERROR else "yellow"


def _head(view: RigView) -> Text:
    minutes, seconds = divmod(int(view.elapsed_s), 60)
    return Text.assemble(
        (f" {view.rig.name}", "bold"),
        f"   {minutes:02d}:{seconds:02d}   applications connect to ",
        (view.rig.endpoint, "cyan"),
    )


def _table(*columns: str) -> Table:
    # The first column is a name; what follows are numbers.
    table = Table(box=None, padding=(0, 2, 0, 1), header_style="dim", pad_edge=False)
    for index, column in enumerate(columns):
        table.add_column((" " if index == 0 else "") + column, justify="left" if index == 0 else "right", no_wrap=True)
    return table


def _streams(view: RigView) -> RenderableType:
    table = _table("stream", "rate", "age", "images", "dropped")
    for stream in view.streams:
        table.add_row(
            Text(f" {stream.name}"),
            f"{stream.rate_hz:.1f} Hz",
            "–" if stream.age_ms is None else f"{stream.age_ms:.0f} ms",
            str(stream.published),
            Text(str(stream.dropped), style="yellow" if stream.dropped else ""),
        )
    return table if view.streams else Text(" no images yet", style="dim")


def _trackers(view: RigView) -> RenderableType:
    table = _table("tracker", "status", "error", "surface", "solve", "age", "search", "skipped")
    parts: list[RenderableType] = [table, _shares(view)]
    for name, tracker in view.live.trackers.items():
        if silence := view.silent.get(name):
            parts.append(Text(f" {name}: {silence}", style="red"))
            continue
        table.add_row(f" {name}", *_numbers(tracker))
        if tracker.last is not None:
            parts.append(_theta(name, tracker.last))
            parts += [
                Text(f" {name}: {reason}", style="yellow") for reason in tracker.last.reasons + tracker.last.warnings
            ]
    return Group(*parts)


def _numbers(tracker: TrackerLog) -> list[RenderableType]:
    last = tracker.last
    if last is None:
        return [Text("–", style="dim")] * 7
    return [
        Text(last.status, style=STATUS_COLORS.get(last.status, "")),
        "–" if last.error_mm is None else f"{last.error_mm:.2f} mm",
        "–" if last.surface_mm is None else f"{last.surface_mm:.2f} mm",
        f"{last.solve_ms:.1f} ms",
        "–" if last.age_ms is None else f"{last.age_ms:.0f} ms",
        f"{last.generations}/{last.evaluations}",
        str(tracker.skipped),
    ]


def _shares(view: RigView) -> RenderableType:
    """Shares of the vertices that face each sensor, of the last estimates."""
    columns = ("agree", "off", "missing", "behind", "itself", "outside", "beyond")
    table = _table("vertices", *columns)
    for name, tracker in view.live.trackers.items():
        for sensor, shares in tracker.last.shares.items() if tracker.last and name not in view.silent else ():
            values = (
                shares.agreeing, shares.disagreeing, shares.no_return, shares.occluder, shares.self_occluded,
                shares.outside, shares.unexplained,
            )  # fmt: skip
            table.add_row(Text(f" {name} {sensor}"), *("–" if one is None else f"{one:.0%}" for one in values))
    return table if table.row_count else Group()


def _theta(name: str, report: EstimateReport) -> Text:
    numbers = " ".join(f"{value:+.3f}" for value in report.theta)
    text = Text(f" {name} Θ[{len(report.theta)}] {numbers}", style="dim", no_wrap=True, overflow="ellipsis")
    return text


def _recording(view: RigView) -> RenderableType:
    recording = view.recording
    if recording is None:
        return Text(f" recording {view.recording_remark}" if view.recording_remark else " not recording", style="dim")
    text = Text(f"recording {recording.file.name}  {size(recording.size)}  {size(recording.rate)}/s  ")
    text.append(f"{recording.dropped} dropped", style="yellow" if recording.dropped else "")
    text.append(f"  {view.recording_remark}", style="dim")
    text.append(f"  {recording.forecast}", style="dim")
    return Padding(text, (0, 0, 0, 1))  # what does not fit goes on in the next line, indented, too


def _processes(view: RigView) -> Text:
    text = Text(" processes")
    for child in view.children:
        number = str(child.process.pid) if child.state is ChildState.RUNNING else child.state.value
        text.append(f"  {escape(child.component)} ")
        text.append(number, style=_STATE.get(child.state, "dim"))
        if child.restarts:
            text.append(f" restarted {child.restarts}×", style="yellow")
    return text
