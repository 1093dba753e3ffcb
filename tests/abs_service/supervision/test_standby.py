"""A recorder that waits takes over at once."""

import os
import sys
import threading

import pytest

from abs_service.supervision import parent_watchdog
from abs_service.supervision.child_process import ChildProcess, ThreadTimes
from abs_service.supervision.standby import Standby
from tests.abs_service.supervision.idle_process import Idle
from tests.waiting import eventually


class Waiting(Idle):
    """One that was started to wait."""


@pytest.fixture
def started():
    return []


@pytest.fixture
def standby(started):
    def start(kind, component):
        started.append(kind(component))
        return started[-1]

    standby = Standby("record", lambda name, _: start(Idle, name), lambda name, _: start(Waiting, name), delay_s=0.0)
    yield standby
    standby.close()


def test_the_second_start_wakes_the_process_that_waits_and_prepares_another_one(standby, started):
    first = standby("record", ())
    assert type(first) is Idle
    assert eventually(lambda: len(started) == 2)
    second = standby("record", ())
    assert second is started[1]
    assert second.woken
    assert eventually(lambda: len(started) == 3)
    assert not started[2].woken


def test_other_components_start_as_ever(standby, started):
    assert type(standby("capture", ())) is Idle
    assert type(standby("capture", ())) is Idle
    assert len(started) == 2


def test_a_process_that_still_loads_is_replaced_by_one_that_loads_faster(standby, started, monkeypatch):
    standby("record", ())
    assert eventually(lambda: len(started) == 2)
    monkeypatch.setattr(started[1], "threads", lambda: {1: ThreadTimes(), 2: ThreadTimes(runnable=True)})
    assert type(standby("record", ())) is Idle
    assert not started[1].woken
    assert started[1].poll() is not None


def test_a_waiting_process_that_has_ended_is_not_woken(standby, started):
    standby("record", ())
    assert eventually(lambda: len(started) == 2)
    started[1].terminate()
    assert type(standby("record", ())) is Idle


def test_closing_ends_the_one_that_waits(standby, started):
    standby("record", ())
    assert eventually(lambda: len(started) == 2)
    standby.close()
    assert started[1].poll() == 0
    assert type(standby("record", ())) is Idle
    assert len(started) == 3


def test_a_real_process_waits_until_it_is_woken(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    said, lines = threading.Event(), []
    code = (
        "import os, sys\nfrom abs_service.supervision import parent_watchdog\nparent_watchdog.start()\n"
        "before = os.nice(0)\nparent_watchdog.load_gently('wave')\nassert 'wave' in sys.modules\nprint('loaded')\n"
        "parent_watchdog.wait_until_needed()\nprint('works', os.nice(0) - before)"
    )

    def on_line(component, line):
        lines.append(line)
        said.set()

    process = ChildProcess("x", ["-c", code], on_line, (sys.executable,), {parent_watchdog.STANDBY: "1"})
    assert said.wait(10)
    assert process.poll() is None
    assert lines == ["loaded"]
    process.wake()
    assert eventually(lambda: process.poll() == 0)
    assert process.output_tail() == "loaded\nworks 0"
    process.wake()  # harmless
