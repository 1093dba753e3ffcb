"""The panel beside the scene, without a browser."""

from contextlib import redirect_stdout
from functools import partial
from io import StringIO

import numpy as np
import pytest

viser = pytest.importorskip("viser")

from abs_service.display.page.panel import Button, Panel  # noqa: E402 - needs viser
from abs_service.display.page.readouts.plots import STEPS  # noqa: E402 - needs viser
from abs_service.display.page.scene.fields import PALETTES  # noqa: E402 - needs viser


@pytest.fixture
def server():
    """A page that nobody opens."""
    with redirect_stdout(StringIO()):
        opened = viser.ViserServer("127.0.0.1", 0, verbose=False)
        yield opened
        opened.stop()


@pytest.fixture
def pressed(server, monkeypatch):
    """Presses of the page's buttons by label, filled while a panel is made."""
    found, add = {}, server.gui.add_button

    def spy(label, **options):
        button = add(label, **options)
        monkeypatch.setattr(button, "on_click", lambda call: found.update({label: partial(call, None)}))
        return button

    monkeypatch.setattr(server.gui, "add_button", spy)
    return found


def test_buttons_are_those_that_are_given_and_act(server, pressed):
    acted = []
    Panel(server, {name: Button("", partial(acted.append, name)) for name in ("Reinitialise", "Start recording")})
    assert list(pressed) == ["Reinitialise", "Start recording"]
    pressed["Start recording"]()
    assert acted == ["Start recording"]


def test_buttons_without_use_are_grey_and_say_why(server, monkeypatch, added):
    buttons, add = {}, server.gui.add_button
    monkeypatch.setattr(
        server.gui, "add_button", lambda label, **options: buttons.setdefault(label, add(label, **options))
    )
    panel = Panel(server, {name: Button("", print) for name in ("Reinitialise", "Start recording")})
    for reason in ("Always recording", ""):
        panel.grey(("Start recording", "Stop recording"), reason)
        assert {name: button.disabled for name, button in buttons.items()} == {
            "Reinitialise": False,
            "Start recording": bool(reason),
        }
        assert next(one.visible for one in added if getattr(one, "content", None) == reason) == bool(reason)


def test_a_page_that_only_shows_has_none(server, pressed):
    Panel(server, {})
    assert pressed == {}


@pytest.fixture
def added(server, monkeypatch):
    """The plots, images and texts of a page, in the order in which they were added."""
    found = []

    def spy(add, *arguments, **options):
        found.append(add(*arguments, **options))
        return found[-1]

    for name in ("add_uplot", "add_image", "add_markdown"):
        monkeypatch.setattr(server.gui, name, partial(spy, getattr(server.gui, name)))
    return found


def test_a_plot_shows_the_curves_that_it_is_given_last(server, added):
    panel = Panel(server, {})
    for name, value in (("Θ1", 1.0), ("Θ1", 2.0), ("Θ2", 3.0)):
        panel.show_plots({"Θ": {name: np.full(STEPS, value)}})
        plot = added[-1]
        assert [one["label"] for one in plot.series] == ["s", name]
        assert (plot.data[1] == value).all()
    assert added.count(plot) == 1


def test_a_plot_without_curves_is_taken_away_and_comes_back(server, added):
    panel, curves = Panel(server, {}), {"Θ1": np.ones(STEPS)}
    panel.show_plots({"Θ": curves, "σ": curves})
    panel.show_plots({"Θ": curves})
    panel.show_plots({"Θ": curves, "σ": curves})
    assert [getattr(plot, "title", "") for plot in added].count("σ") == 2
    assert [getattr(plot, "title", "") for plot in added].count("Θ") == 1


def test_plots_have_the_same_minute_however_little_of_it_has_values(server, added):
    Panel(server, {}).show_plots({"rate": {"rate": np.full(STEPS, np.nan)}})
    assert added[-1].scales["x"]["range"] == (-60.0, 0.0)


def test_an_image_is_updated_and_can_be_taken_away_and_shown_again(server, added):
    panel, image = Panel(server, {}), np.zeros((4, 4, 3), np.uint8)
    assert not panel.shows_residual
    panel.hide_image("residual")
    for label in ("1 mm", "2 mm"):
        panel.show_image("residual", label, image)
    panel.hide_image("residual")
    panel.show_image("residual", "3 mm", image)
    assert [one.label for one in added if isinstance(one, viser.GuiImageHandle)][-2:] == ["2 mm", "3 mm"]


def test_numbers_are_a_table_whose_cells_hold_any_text(server, added):
    panel = Panel(server, {})
    panel.show_table({"estimates": "30 Hz", "a|b": "<b>"})
    rows = [one.content for one in added if isinstance(one, viser.GuiMarkdownHandle) and one.content]
    assert rows == ["| | |\n|-|-|\n| estimates&emsp;| 30 Hz |\n| a\\|b&emsp;| &lt;b&gt; |"]


def test_the_legend_has_the_colours_and_the_end_of_the_chosen_quantity(server, added):
    panel = Panel(server, {})
    assert not any(one.visible for one in added if isinstance(one, viser.GuiImageHandle))
    panel.show_legend(5.0)
    legend = next(one for one in added if isinstance(one, viser.GuiImageHandle))
    assert legend.visible
    assert legend.label == "0 … 5 mm"
    assert (legend.image[0, ::2] == PALETTES[False]).all()


def test_links_to_other_rigs_are_shown_if_there_are_some(server, monkeypatch):
    added, add = [], server.gui.add_html
    monkeypatch.setattr(
        server.gui, "add_html", lambda *given, **options: added.append(add(*given, **options)) or added[-1]
    )
    panel = Panel(server, {})
    panel.show_neighbours("")
    assert not added[-1].visible
    panel.show_neighbours("<a>right</a>")
    assert added[-1].visible
    assert added[-1].content == "<a>right</a>"
