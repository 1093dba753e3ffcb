"""The controls of the page: status in words, colours, images, plots, buttons."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from typing import NamedTuple

import numpy as np
import viser
from viser import uplot

from abs_service.display.page.numbers import MINUTE_S
from abs_service.display.page.pictures import Picture
from abs_service.display.page.readouts.plots import Curves, complete
from abs_service.display.page.readouts.words import StatusLine
from abs_service.display.page.scene.fields import FIELDS, PALETTES
from abs_service.display.page.style import GONE, STYLE

#: Room around a plot, from its top clockwise [px]: half of a number at the end of an axis lies in it.
PADDING = 10, 12, 0, 8

_LINES = ("#3b82f6", "#f59e0b", "#10b981", "#ef4444", "#a78bfa")


@dataclass(frozen=True, slots=True)
class Button:
    """A button: its explanation, and what is called when it is pressed."""

    hint: str
    press: Callable[[], None]


class Shown(NamedTuple):
    """Check boxes for parts of the scene: True to draw them."""

    first_pose: bool
    points: bool
    cameras: bool


class Panel:
    """The panel beside the scene."""

    def __init__(self, server: viser.ViserServer, buttons: Mapping[str, Button]) -> None:
        self._server, gui = server, server.gui
        gui.main_panel.dock_right()
        gui.configure_theme(control_width="large", dark_mode=True, show_logo=False, show_share_button=False)
        gui.add_html(STYLE, order=-1.0)
        self._status, self._renewed = gui.add_html("", order=0.0), 0
        self._neighbours = gui.add_html("", order=0.1, visible=False)
        self._tracker = gui.add_dropdown("Tracker", list[str](["–"]), visible=False)
        self._tabs = tabs = gui.add_tab_group()
        with tabs.add_tab("View"):
            # First, so that they stay where they are whatever is shown below them.
            self._buttons = {label: gui.add_button(label, hint=button.hint) for label, button in buttons.items()}
            self._reason = gui.add_markdown("", visible=False)
            self._answer = gui.add_markdown("", visible=False)
            self._field = gui.add_dropdown("Colour of the mesh", tuple(FIELDS))
            self._legend = gui.add_image(np.zeros((16, 512, 3), np.uint8), visible=False)
            self._first = gui.add_checkbox("First pose", True)
            self._points = gui.add_checkbox("Measured points", True)
            self._cameras = gui.add_checkbox("Cameras", True)
            self._table = gui.add_markdown("")
        for label, button in buttons.items():
            self._buttons[label].on_click(partial(_press, button))
        self._image_tab = tabs.add_tab("Images")
        with self._image_tab:
            self._residual = gui.add_checkbox("Residual", False, hint="Measured minus expected distance, in colours")
        self._images: dict[str, viser.GuiImageHandle] = {}
        self._plot_tab = tabs.add_tab("Plots")
        self._plots: dict[str, viser.GuiUplotHandle] = {}

    def add_tab(self, label: str) -> viser.GuiTabHandle:
        """Adds a tab after the others, for further controls."""
        return self._tabs.add_tab(label)

    @property
    def tracker(self) -> str:
        """The tracker that is shown."""
        return self._tracker.value

    @property
    def field(self) -> str:
        """The quantity that the mesh's colours show, a key of `FIELDS`."""
        return self._field.value

    @property
    def shows_residual(self) -> bool:
        """Check box for the residual's images: True to draw them."""
        return self._residual.value

    @property
    def shows(self) -> Shown:
        """Parts of the scene that are to be drawn beside the mesh."""
        return Shown(self._first.value, self._points.value, self._cameras.value)

    def offer(self, trackers: Sequence[str]) -> None:
        """Offers trackers to choose from, once there is more than one."""
        if trackers and tuple(trackers) != tuple(self._tracker.options):
            self._tracker.options, self._tracker.visible = tuple(trackers), len(trackers) > 1

    def show_status(self, words: Iterable[StatusLine]) -> None:
        """Shows the status; the first line is the largest. To be called at least every `style.GONE_S` seconds."""
        self._renewed += 1
        lines = [f"<!-- {self._renewed} -->", GONE]
        for number, one in enumerate(words):
            title = f"<b style='font-size:{1.0 if number else 1.25}em'>{escape(one.title)}</b>"
            text = f"<div style='font-size:0.9em;line-height:1.35'>{escape(one.text)}</div>" if one.text else ""
            style = f"background:{one.color};color:white;padding:8px 12px;border-radius:6px;margin:6px 8px"
            lines.append(f"<div class='abs-status' style='{style}'>{title}{text}</div>")
        self._status.content = "".join(lines)

    def show_neighbours(self, links: str) -> None:
        """Shows HTML with links to other rigs."""
        if self._neighbours.content != links:
            self._neighbours.content, self._neighbours.visible = links, bool(links)

    def show_legend(self, end: float) -> None:
        """Shows the colours of the mesh; `end` has the last one."""
        field, self._legend.visible = FIELDS[self.field], True
        label = f"−{end:g} … +{end:g} {field.unit}" if field.signed else f"0 … {end:g} {field.unit}"
        if self._legend.label != label:
            self._legend.label, self._legend.image = (
                label,
                np.tile(PALETTES[field.signed].repeat(2, axis=0), (16, 1, 1)),
            )

    def grey(self, labels: Iterable[str], reason: str) -> None:
        """Disables buttons, those of them that are there, and says why below all; enables them without a reason."""
        shown = [self._buttons[label] for label in labels if label in self._buttons]
        for button in shown:
            if button.disabled != bool(reason):
                button.disabled = bool(reason)
        if shown and self._reason.content != reason:
            self._reason.content, self._reason.visible = reason, bool(reason)

    def show_table(self, rows: Mapping[str, str]) -> None:
        """Shows numbers by name."""
        cells = ("&emsp;| ".join(escape(part).replace("|", "\\|") for part in row) for row in rows.items())
        content = "\n".join(["| | |", "|-|-|", *(f"| {row} |" for row in cells)])
        if self._table.content != content:
            self._table.content = content

    def answer(self, text: str) -> None:
        """Shows the result of an action."""
        self._answer.content, self._answer.visible = text, bool(text)

    def show_image(self, name: str, label: str, picture: Picture) -> None:
        """Shows an image."""
        shown = self._images.get(name)
        if shown is None:
            with self._image_tab:
                self._images[name] = self._server.gui.add_image(picture, label=label, format="jpeg", jpeg_quality=80)
            return
        shown.image = picture
        if shown.label != label:
            shown.label = label

    def hide_image(self, name: str) -> None:
        """Takes an image away, if it is shown."""
        if (shown := self._images.pop(name, None)) is not None:
            shown.remove()

    def show_plots(self, plots: Mapping[str, Curves]) -> None:
        """Shows curves of the last minute by title, and no others."""
        for title in self._plots.keys() - plots.keys():
            self._plots.pop(title).remove()
        for title, curves in plots.items():
            data, known = complete(list(curves.values())), self._plots.get(title)
            series = uplot.Series(label="s"), *_series(curves)
            if known is None:
                with self._plot_tab:
                    axes, scales = (
                        (uplot.Axis(stroke="#bbb"),) * 2,
                        {"x": uplot.Scale(time=False, range=(-MINUTE_S, 0.0))},
                    )
                    add = self._server.gui.add_uplot
                    self._plots[title] = add(
                        data, series, title=title, scales=scales, axes=axes, aspect=2.4, padding=PADDING
                    )
                continue
            with self._server.atomic():
                if known.series != series:
                    known.series = series
                known.data = data


def _series(names: Iterable[str]) -> list[uplot.Series]:
    return [uplot.Series(label=name, stroke=color, width=2) for name, color in zip(names, _LINES)]


def _press(button: Button, _: object) -> None:
    button.press()
