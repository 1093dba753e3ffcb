"""Endpoint and signals of a rig's processes."""

import argparse
import errno
import os
import signal
import threading
from pathlib import Path
from queue import SimpleQueue

import pytest

from abs_service import config
from abs_service.bus.session import BusError
from abs_service.commands.parts import rig_process
from abs_service.commands.parts.rig_process import SecurityError
from abs_service.config.tables.bus import BusTable, TlsTable
from tests.conftest import encrypted


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_first_signal_asks_and_the_second_forces(monkeypatch, number):
    forced = []
    monkeypatch.setattr(os, "_exit", forced.append)
    stop = rig_process.stop_on_signals()
    assert not stop.is_set()
    signal.raise_signal(number)
    assert stop.wait(1.0)
    assert forced == []
    signal.raise_signal(number)
    assert forced == [128 + number]


def test_many_hangups_without_a_terminal_are_one_wish(monkeypatch):
    def no_terminal(path, mode):
        raise OSError(errno.ENXIO, path)

    monkeypatch.setattr(os, "open", no_terminal)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # the tests themselves may run with nohup
    called, go_on, stop = SimpleQueue(), SimpleQueue(), threading.Event()
    monkeypatch.setattr(stop, "wait", lambda seconds: go_on.get(timeout=1.0))
    rig_process.on_hangup(lambda: called.put("reload"), stop)
    signal.raise_signal(signal.SIGHUP)
    assert called.get(timeout=1.0) == "reload"
    for _ in range(100):
        signal.raise_signal(signal.SIGHUP)
    for _ in range(2):
        go_on.put(None)
    assert called.get(timeout=1.0) == "reload"
    stop.set()
    signal.raise_signal(signal.SIGHUP)
    go_on.put(None)
    assert called.empty(), "the bus may be closed by now"


def parse(*arguments):
    parser = argparse.ArgumentParser()
    rig_process.add_arguments(parser)
    return parser.parse_args(arguments)


def test_one_process_may_listen_and_others_connect_to_a_given_endpoint(endpoint):
    rig = rig_process.load_config(parse())
    with (
        rig_process.open_bus(rig, parse("--listen", endpoint), "capture"),
        rig_process.open_bus(rig, parse("--connect", endpoint), "viewer") as bus,
    ):
        assert bus.query("**", 0.1) == []


@pytest.mark.parametrize("option", ["--connect", "--listen"])
@pytest.mark.parametrize("wrong", ["nowhere", ""])
def test_an_endpoint_of_the_command_line_is_checked_like_that_of_the_file(option, wrong):
    rig = rig_process.load_config(parse())
    with (
        pytest.raises(BusError, match=f'^{option} = "{wrong}": not an endpoint'),
        rig_process.open_bus(rig, parse(option, wrong), "viewer"),
    ):
        pass


def test_where_nobody_answers_the_option_is_named(endpoint):
    rig = rig_process.load_config(parse())
    with (
        pytest.raises(BusError, match=f'^--connect = "{endpoint}": nothing answers there'),
        rig_process.open_bus(rig, parse("--connect", endpoint), "viewer"),
    ):
        pass


def test_a_port_in_use_is_changed_where_it_was_given(endpoint):
    rig = rig_process.load_config(parse())
    with (
        rig_process.open_bus(rig, parse("--listen", endpoint), "capture"),
        pytest.raises(BusError, match=f'^--listen = "{endpoint}": the address is in use; .* give --listen another'),
        rig_process.open_bus(rig, parse("--listen", endpoint), "capture"),
    ):
        pass


def test_an_endpoint_of_the_command_line_is_encrypted_if_that_of_the_file_is():
    rig = config.load_default()
    bus = BusTable(endpoint="tls/lab4:7447", tls=TlsTable(authority=Path("a"), certificate=Path("c"), key=Path("k")))
    with (
        pytest.raises(BusError, match=r'^--connect = "tcp/lab4:7447": must begin with tls/'),
        rig_process.open_bus(rig.model_copy(update={"bus": bus}), parse("--connect", "tcp/lab4:7447"), "viewer"),
    ):
        pass


def test_a_certificate_that_is_of_no_use_to_a_process_is_named_with_its_file(keys, endpoint, tmp_path):
    tls = {"authority": "authority.pem", "certificate": "viewer.pem", "key": "viewer.key"}
    rig = config.load_default()
    bus = BusTable(endpoint=encrypted(endpoint), tls=TlsTable(**{key: keys / file for key, file in tls.items()}))
    arguments = parse("rig.toml")
    with (
        pytest.raises(
            SecurityError, match=r'^rig\.toml: bus\.tls\.certificate = ".*": its name is "viewer"; .* tracker or rig'
        ),
        rig_process.open_bus(rig.model_copy(update={"bus": bus}), arguments, "tracker"),
    ):
        pass


def test_a_process_cannot_both_listen_and_connect(endpoint, capsys):
    with pytest.raises(SystemExit):
        parse("--listen", endpoint, "--connect", endpoint)
    assert "not allowed with" in capsys.readouterr().err
