"""Hostile messages: none ends `abs-service run` or reaches the terminal as more than text."""

import io
import itertools
import math
import time

import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health as Message
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console
from rich.text import Text

from abs_service.bus.stamps import WallClock
from abs_service.display.terminal.lines import JsonDisplay, PlainDisplay
from abs_service.display.terminal.output import Output
from abs_service.display.terminal.table import draw
from abs_service.supervision.display import Display
from abs_service.supervision.health.rig_view import RigPlaces
from abs_service.supervision.run_session import RunSession
from abs_service.supervision.supervisor import Supervisor
from abs_service.wire.checked_bus import CheckedBus
from tests.abs_service.bus.loopback import LoopbackBus
from tests.abs_service.wire.hostile import samples
from tests.abs_service.wire.test_edge import sample

HOSTILE = st.lists(samples(), min_size=1, max_size=5)


class Now(Output):
    """Output that has arrived when it is written."""

    def put(self, item):
        self._act(item)


class Everything(Display):
    """All displays at once, drawn to the last character."""

    def __init__(self):
        self.out, self.lines = io.StringIO(), io.StringIO()
        self._console = Console(file=self.out, width=120, color_system=None)
        lines = Now(self.lines.write)
        self._others = PlainDisplay(lines, lines), JsonDisplay(lines, lines)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        """No operation."""

    def update(self, view):
        self._console.print(draw(view, Text("")))
        for display in self._others:
            display.update(view)

    def estimate(self, report):
        for display in self._others:
            display.estimate(report)

    def note(self, text):
        pass

    def close(self, view):
        self._console.print("\n".join(view.summary()), highlight=False, markup=False)
        return 0


class Run:
    """`abs-service run` without processes."""

    def __init__(self):
        self.bus, self.shown = LoopbackBus(), Everything()
        supervisor = Supervisor([], lambda component, _: pytest.fail(component), time.monotonic_ns)
        places = RigPlaces("demo", "tcp/127.0.0.1:1")
        checked = CheckedBus(self.bus, time.monotonic_ns)
        self.session = RunSession(checked, places, ["sheet"], supervisor, self.shown, WallClock())

    def take(self, *hostile):
        for one in hostile:
            self.bus.deliver(one)
        turns = itertools.count()
        self.session.run_until(lambda: next(turns) > 1)
        self.shown.close(self.session.view())

    @property
    def said(self):
        published = [one for one in self.bus.sent if one.topic == "health/run"]
        return Message.FromString(published[-1].payload)


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr("abs_service.supervision.run_session.PERIOD_S", 0.002)


class TestRun:
    def test_a_file_of_infinite_size(self):
        run = Run()
        health = Message(component="record", labels={"file": "a.mcap"}, gauges={"file_bytes": math.inf})
        run.take(sample("health/record", health))
        assert "not recording" in run.shown.out.getvalue()
        assert run.said.counters["refused.number"] == 1
        assert "run: refused 1 messages, the last: health/record: " in run.shown.out.getvalue()

    def test_an_estimate_of_unknown_age(self):
        run = Run()
        run.take(sample("sheet/state", DeformationState(tracker="sheet", age_ms=math.nan)))
        run.take(sample("sheet/state", DeformationState(tracker="sheet", age_ms=math.nan)))
        assert "UNSPECIFIED" in run.shown.out.getvalue()
        assert '"age_ms": null' in run.shown.lines.getvalue()

    def test_escape_sequences_do_not_reach_the_terminal(self):
        run = Run()
        run.take(
            sample("health/capture", Message(component="capture", level=Message.LEVEL_ERROR, message="\x1b[2Jgone"))
        )
        run.take(sample("sheet/state", DeformationState(tracker="sheet", reasons=["\x1b[2Jgone"])))
        assert "\x1b" not in run.shown.out.getvalue() + run.shown.lines.getvalue()
        assert run.said.counters["refused.text"] >= 1

    def test_names_that_look_like_markup_are_shown_as_they_are(self):
        run = Run()
        run.take(sample("health/capture", Message(component="capture", counters={"published.[/x]/image": 1})))
        assert "[/x]" in run.shown.out.getvalue()

    @settings(max_examples=200)
    @given(HOSTILE)
    def test_nothing_ends_it(self, hostile):
        run = Run()
        run.take(*hostile)
        assert "\x1b" not in run.shown.out.getvalue() + run.shown.lines.getvalue()
