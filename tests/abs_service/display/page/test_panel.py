"""The panel beside the scene, without a browser."""

from contextlib import redirect_stdout
from functools import partial
from io import StringIO

import numpy as np
import pytest

viser = pytest.importorskip("viser")

from abs_service.display.page.panel import Button, Panel  # noqa: E402 - needs viser
from abs_service.display.page.plots import STEPS  # noqa: E402 - needs viser


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


def test_a_page_that_only_shows_has_none(server, pressed):
    Panel(server, {})
    assert pressed == {}


def test_a_plot_shows_the_curves_that_it_is_given_last(server, monkeypatch):
    drawn, add = [], server.gui.add_uplot

    def spy(*arguments, **options):
        drawn.append(add(*arguments, **options))
        return drawn[-1]

    monkeypatch.setattr(server.gui, "add_uplot", spy)
    panel = Panel(server, {})
    for name, value in (("Θ1", 1.0), ("Θ1", 2.0), ("Θ2", 3.0)):
        panel.show_plots({"Θ": {name: np.full(STEPS, value)}})
        (plot,) = drawn
        assert [one["label"] for one in plot.series] == ["s", name]
        assert (plot.data[1] == value).all()
