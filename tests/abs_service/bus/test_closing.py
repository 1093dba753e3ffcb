"""The end of a bus: it closes at once, whatever was declared and whatever a callback does."""

import subprocess
import sys
import threading
from typing import Any

import pytest
import zenoh

from abs_service.bus import zenoh_bus
from abs_service.bus.session import SessionMode
from abs_service.bus.zenoh_bus import ZenohBus


def test_a_process_with_everything_declared_ends_at_once(endpoint):
    program = f"""
from abs_service.bus.contract import STATE
from abs_service.bus.session import SessionMode
from abs_service.bus.zenoh_bus import ZenohBus
with ZenohBus.open("demo", "{endpoint}", SessionMode.ROUTER) as bus:
    bus.subscribe("**", print)
    bus.watch_liveliness(print)
    bus.latched_publisher("config", "absmsg.v1.Config").put(b"x")
    bus.publisher("sheet/state", "absmsg.v1.DeformationState", STATE).put(b"y")
"""
    ended = subprocess.run([sys.executable, "-c", program], check=False, timeout=10, stdout=subprocess.DEVNULL)
    assert ended.returncode == 0


def test_closing_twice_is_fine(endpoint):
    bus = ZenohBus.open("demo", endpoint, SessionMode.ROUTER, shared_memory=False)
    bus.close()
    bus.close()
    with ZenohBus.open("demo", endpoint, SessionMode.ROUTER) as again:  # which it can only once the endpoint is free
        assert list(again.query("**", 0.1)) == []


def test_a_callback_that_does_not_return_is_left_behind_with_a_warning(caplog):
    class Session:
        def is_closed(self) -> bool:
            return False

        def close(self):
            raise zenoh.ZError("close operation timed out!")

    session: Any = Session()
    ZenohBus(session, "demo").close()
    assert "rig demo: the session did not close, a callback has not returned" in caplog.text


def test_closing_ends_within_a_second_whatever_a_callback_does(caplog, monkeypatch):
    monkeypatch.setattr(zenoh_bus, "CLOSE_S", 0.05)
    returns = threading.Event()

    class Session:
        def is_closed(self) -> bool:
            return False

        def close(self):
            returns.wait()

    session: Any = Session()
    ZenohBus(session, "demo").close()
    assert not returns.is_set()
    assert "a callback has not returned: no answer within" in caplog.text
    returns.set()


@pytest.mark.slow
def test_a_process_ends_though_a_callback_waits_for_ever(endpoint):
    program = f"""
import threading
from abs_service import cli
from abs_service.bus.contract import EVENTS
from abs_service.bus.session import SessionMode
from abs_service.bus.zenoh_bus import ZenohBus

def main():
    entered = threading.Event()
    def wait_for_ever(sample):
        entered.set()
        threading.Event().wait()
    with ZenohBus.open("demo", "{endpoint}", SessionMode.ROUTER) as bus:
        bus.subscribe("x", wait_for_ever)
        publisher = bus.publisher("x", "m", EVENTS)
        while not entered.wait(0.02):
            publisher.put(b"")
    print("done")
    return 7

cli.main = main
cli.program()
"""
    ended = subprocess.run([sys.executable, "-c", program], check=False, timeout=20, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (7, "done\n")
    assert "left behind, since they do not end: " in ended.stderr


def test_the_interpreter_waits_for_callbacks_that_a_daemon_declared(open_bus):
    bus = open_bus()
    before = set(threading.enumerate())

    def declare():
        bus.latched_publisher("config", "absmsg.v1.Config")
        bus.answer_queries("schema", "bytes", bytes)
        bus.subscribe("**", lambda sample: None)
        bus.watch_liveliness(lambda component, alive: None)

    daemon = threading.Thread(target=declare, daemon=True)
    daemon.start()
    daemon.join()
    callbacks = set(threading.enumerate()) - before
    assert len(callbacks) == 4
    assert not any(thread.daemon for thread in callbacks)
    bus.close()
    for thread in callbacks:
        thread.join(5)
        assert not thread.is_alive()
