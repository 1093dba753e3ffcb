"""Sessions of the bus: endpoints, and errors in opening one that are understood."""

import os
import subprocess
import sys
import threading
import time
from datetime import UTC, datetime

import pytest
import zenoh

from abs_service.bus.session import BusError, SessionMode, UnansweredError, check_endpoint, open_session


@pytest.mark.parametrize(
    "endpoint",
    [
        *("", "7447", "tcp/127.0.0.1", "tcp/127.0.0.1:99999", "tcp/127.0.0.1:0", "ftp/127.0.0.1:1", "tcp/a b:1"),
        # The first two keep everybody out, or panic; zenoh cannot read the others.
        *("tcp/127.0.0.1:7447?prio=0-99", "tcp/127.0.0.1:7447?rel=9", "tcp/127.0.0.1:7447#", "tcp/127.0.0.1:7447#;"),
    ],
)
@pytest.mark.parametrize("role", SessionMode)
def test_a_malformed_endpoint_is_explained(endpoint, role):
    with pytest.raises(BusError, match=r'bus\.endpoint = ".*": not an endpoint; write PROTOCOL/HOST:PORT'):
        open_session(endpoint, role)


@pytest.mark.parametrize("endpoint", ["tcp/127.0.0.1:7447", "tls/host.example:1", "tcp/[::1]:65535", "ws/a:1#x=1;y=2"])
def test_endpoints_that_are_fine(endpoint):
    assert check_endpoint(endpoint) == endpoint


def test_a_port_in_use_is_explained(open_bus, endpoint):
    open_bus()
    with pytest.raises(
        BusError, match=rf'bus.endpoint = "{endpoint}": the address is in use; .* set endpoint in the table \[bus\]'
    ):
        open_session(endpoint, SessionMode.ROUTER)


def test_a_router_that_is_not_there_is_explained(endpoint, monkeypatch):
    monkeypatch.setattr("abs_service.bus.session.CONNECT_TIMEOUT_MS", 200)
    with pytest.raises(UnansweredError, match=f'bus.endpoint = "{endpoint}": nothing answers there'):
        open_session(endpoint, SessionMode.CLIENT)


@pytest.mark.parametrize("host", ["no-such-host.invalid", "h" * 70, "x..y"])
def test_a_name_without_an_address_is_told_from_a_host_that_does_not_answer(host):
    with pytest.raises(UnansweredError, match=f'the name "{host}" cannot be resolved: .*; correct it'):
        open_session(f"tcp/{host}:7447", SessionMode.CLIENT, connect_timeout_ms=200)


def test_a_name_server_that_does_not_answer_is_not_waited_for(monkeypatch):
    ended = threading.Event()
    monkeypatch.setattr("socket.getaddrinfo", lambda *_: ended.wait(30))
    with pytest.raises(UnansweredError, match="cannot be resolved: no name server answers"):
        open_session("tcp/no-such-host.invalid:7447", SessionMode.CLIENT, connect_timeout_ms=200)
    ended.set()


def test_an_unknown_host_is_explained_without_the_source_of_zenoh():
    with pytest.raises(BusError, match="cannot listen there") as error:
        open_session("tcp/no-such-host.invalid:7447", SessionMode.ROUTER)
    assert ".rs" not in str(error.value)


def test_a_sender_whose_wall_clock_is_ahead_fills_no_log(endpoint, capfd):
    with open_session(endpoint, SessionMode.ROUTER) as router, open_session(endpoint, SessionMode.CLIENT) as client:
        arrived = threading.Event()
        subscriber = router.declare_subscriber("abs/x/y", lambda _: arrived.set())
        client.put("abs/x/y", b"", timestamp=zenoh.Timestamp.parse_rfc3339("2099-01-01T00:00:00.000000000Z/33"))
        assert arrived.wait(5)
        subscriber.undeclare()
    assert capfd.readouterr() == ("", "")


def test_lines_of_zenoh_have_no_escape_sequences_where_no_terminal_is(endpoint):
    code = f"import abs_service.bus.session as s; s.open_session({endpoint!r}, s.SessionMode.ROUTER).close()"
    environment = {name: text for name, text in os.environ.items() if name != "NO_COLOR"} | {"RUST_LOG": "info"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    said = done.stdout + done.stderr
    assert "zenoh" in said
    assert "\x1b" not in said


@pytest.mark.parametrize("year", [1969, 2107])
def test_a_wall_clock_beyond_the_times_of_zenoh_is_told(year, endpoint, monkeypatch):
    monkeypatch.setattr(time, "time", lambda: datetime(year, 1, 1, tzinfo=UTC).timestamp())
    with pytest.raises(BusError, match=f"the wall clock is set to {year}-01-01: zenoh needs one between"):
        open_session(endpoint, SessionMode.ROUTER)
