"""Interactive guide for the person holding a board: coverage of each sensor, and the next instruction."""

from collections.abc import Sequence
from typing import Protocol, Self

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.columns import Columns
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.text import Text

from abs_service.calibration.shots.collection import Collector
from calib.board import coverage
from calib.board.corners.to_8bit import Image, grey
from calib.board.views import CornerView

#: Cells of the map in the terminal, and symbols for no points, some, many.
_COLUMNS, _ROWS = 12, 7
_SIGNS = "·░▒▓█"
#: Number of instructions shown at a time.
_SHOWN = 3
#: Style of a map: points, and ninths of the image without points.
_POINT, _UNSEEN = (40, 200, 60), (60, 60, 230)


class Guide(Protocol):
    """Displays the progress of a collection; a context manager."""

    def __enter__(self) -> Self:
        """Starts the display, if it has to be."""
        return self

    def __exit__(self, *error: object) -> None:
        """Stops the display."""
        return

    def update(self, collector: Collector, is_kept: bool) -> None:
        """Shows the result of one shot."""
        ...


class LiveGuide(Guide):
    """Coverage maps in a terminal, redrawn with every shot."""

    def __init__(self, console: Console) -> None:
        self._live = Live(console=console, refresh_per_second=6, transient=True)

    def __enter__(self) -> Self:
        """See `Guide`."""
        self._live.start()
        return self

    def __exit__(self, *error: object) -> None:
        """See `Guide`."""
        self._live.stop()

    def update(self, collector: Collector, is_kept: bool) -> None:
        """See `Guide`."""
        self._live.update(draw(collector))


class LineGuide(Guide):
    """One line for every kept shot and for every new reason for rejection, for files and pipes."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._latest = ""

    def update(self, collector: Collector, is_kept: bool) -> None:
        """See `Guide`."""
        next_ = "; ".join(missing.text for missing in collector.missing_views[:1]) or "enough"
        reasons = "; ".join(f"{sensor}: {why}" for sensor, why in collector.latest.items() if why)
        line = f"kept {collector.kept}. Next: {next_}" if is_kept else reasons
        if line and (is_kept or line != self._latest):
            self._console.print(line, highlight=False, markup=False, soft_wrap=True)
        self._latest = line


def draw(collector: Collector) -> RenderableType:
    """State of a collection: a map for each sensor, the result of the last shot, missing views."""
    maps = [_panel(sensor, size, collector) for sensor, size in collector.sizes.items()]
    missing_views = collector.missing_views
    lines = [Text(f"{collector.kept} shots kept", style="bold")]
    lines += [
        Text(f"→ {_with_sensor(missing.sensor, missing.text)}", style="cyan") for missing in missing_views[:_SHOWN]
    ]
    if len(missing_views) > _SHOWN:
        lines.append(Text(f"  and {len(missing_views) - _SHOWN} more", style="dim"))
    return Group(Columns(maps), *lines)


def _with_sensor(sensor: str, text: str) -> str:
    return text if sensor in text else f"{sensor}: {text}"


def _panel(sensor: str, size: tuple[int, int], collector: Collector) -> Panel:
    views = [view for view in collector.views if view.sensor == sensor]
    counts = coverage.counts(views, size, _COLUMNS, _ROWS)
    level = np.ceil((len(_SIGNS) - 1) * np.minimum(counts / 8, 1)).astype(int)
    rows = ["".join(2 * _SIGNS[cell] for cell in row) for row in level]
    why = collector.latest.get(sensor, "")
    state = Text(why or f"{collector.poses[sensor]} poses", style="yellow" if why else "green", overflow="fold")
    return Panel(Group(*map(Text, rows), state), title=sensor, width=2 * _COLUMNS + 4)


def coverage_map(image: Image, views: Sequence[CornerView]) -> NDArray[np.uint8]:
    """Image of a sensor with the points of its views; ninths of the image without points are red (BGR)."""
    levels = (0.4 * grey(image)).astype(np.uint8)
    size = (levels.shape[1], levels.shape[0])
    picture = np.repeat(levels[..., None], 3, axis=2)
    seen = coverage.counts(views, size, 3, 3)
    for row, column in np.argwhere(seen < coverage.MIN_POINTS):
        part = (
            slice(row * size[1] // 3, (row + 1) * size[1] // 3),
            slice(column * size[0] // 3, (column + 1) * size[0] // 3),
        )
        picture[part] = (0.6 * picture[part] + 0.4 * np.array(_UNSEEN)).astype(np.uint8)
    radius = max(size[0] // 250, 1)
    for u, v in np.rint(np.concatenate([np.zeros((0, 2)), *(view.pixels for view in views)])).astype(int):
        cv2.circle(picture, (int(u), int(v)), radius, _POINT, -1)
    return picture
