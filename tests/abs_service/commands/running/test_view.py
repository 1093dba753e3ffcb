"""`abs-service view`, and `run --view`, without a browser."""

import socket
import threading
from contextlib import nullcontext
from pathlib import Path

import pytest

from abs_service import config
from abs_service.cli import command_parser, main
from abs_service.commands import run
from abs_service.commands.parts.options import OptionError
from abs_service.commands.running import view
from tests.abs_service.bus.loopback import LoopbackBus


@pytest.mark.parametrize(
    ("options", "given"),
    [
        ([], None),
        (["--view"], ()),
        (["--view", "--view-port", "8081", "--view-only"], ("--port", "8081", "--view-only")),
        (["--view-port", "0"], ("--port", "0")),
        (["--view-only"], ("--view-only",)),
    ],
)
def test_run_serves_a_page_only_if_asked_with_the_options_of_view(options, given):
    page = run.page_options(command_parser("run", run).parse_args(options))
    children = {child.component: child.arguments for child in run.children(config.load_default(), Path("x.toml"), page)}
    assert [*children] == ["capture", "track/sheet", "record", *(["view"] if given is not None else [])]
    assert children.get("view") == (None if given is None else ("view", "x.toml", *given))
    if given is not None:
        command_parser("view", view).parse_args(children["view"][1:])  # they are options of view


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["x.mcap", "--connect", "tcp/127.0.0.1:1"], "a recording is read from its file"),
        (["x.mcap"], "x.mcap: No such file"),
        (["rig.toml", "x.mcap"], "x.mcap: a recording is shown alone"),
        (["a.toml", "b.toml", "--connect", "tcp/127.0.0.1:1"], "each of several rigs has the endpoint of its file"),
        (["x.mcap.active"], "x.mcap.active: No such file"),
    ],
)
def test_what_cannot_be_shown_is_a_mistake_of_the_user(capsys, arguments, reason):
    pytest.importorskip("viser")
    assert main(["view", *arguments]) == 2
    assert reason in capsys.readouterr().err


@pytest.mark.parametrize("command", [["view", "--port"], ["run", "--view-port"], ["run", "--seed"]])
@pytest.mark.parametrize("number", ["-1", "4294967296", "8e3", "9" * 5000])
def test_what_cannot_be_a_port_or_a_seed_is_refused_before_anything_starts(capsys, command, number):
    with pytest.raises(SystemExit):
        main([*command, number])
    assert f"argument {command[1]}: " in capsys.readouterr().err


def test_a_port_above_which_none_is_free_is_named(monkeypatch):
    pages = pytest.importorskip("abs_service.commands.running.pages")
    with socket.socket() as taken:
        taken.bind((pages.HOST, 0))
        taken.listen()
        port = taken.getsockname()[1]
        monkeypatch.setattr(pages, "LAST_PORT", port)
        with pytest.raises(OptionError, match=f"--port {port}: no port from there to {port} is free"):
            pages.free_port(port)
        monkeypatch.undo()
        assert pages.free_port(port) > port


def test_a_host_without_the_address_of_the_page_is_told(monkeypatch):
    pages = pytest.importorskip("abs_service.commands.running.pages")
    monkeypatch.setattr(pages, "HOST", "192.0.2.1")  # of documentation, RFC 5737
    with pytest.raises(OptionError, match=r"--port 8080: cannot listen at 192\.0\.2\.1: Cannot assign"):
        pages.free_port(8080)


@pytest.mark.parametrize("command", ["view", "run"])
def test_without_viser_the_extra_is_named(monkeypatch, capsys, command):
    monkeypatch.setattr(view, "find_spec", lambda _: None)
    assert main([command, *(["--view"] if command == "run" else [])]) == 2
    assert ".venv/bin/pip install -e '.[view]'" in capsys.readouterr().err


@pytest.fixture
def served(monkeypatch, tmp_path):
    """Serves pages of rigs with these names until `stop`, which is set; returns the pages."""
    pages, made = pytest.importorskip("abs_service.commands.running.pages"), []
    stop = threading.Event()
    stop.set()
    monkeypatch.setattr(pages.rig_process, "stop_on_signals", lambda: stop)
    monkeypatch.setattr(pages.rig_process, "open_bus", lambda *_: nullcontext(LoopbackBus()))

    class Kept(pages.Page):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            made.append(self)

    monkeypatch.setattr(pages, "Page", Kept)

    def served(*names):
        for name in names:
            rig = config.load_default().model_copy(update={"name": name})
            (tmp_path / f"{name}.toml").write_text(config.to_toml(rig), "utf-8")
        assert main(["view", *(str(tmp_path / f"{name}.toml") for name in names), "--port", "0"]) == 0
        return made

    return served


def test_each_of_several_rigs_has_a_page_with_links_to_the_others(served, capsys):
    left, right, third = served("left", "right", "third")
    assert [one.name for one in right.neighbours] == ["left", "third"]
    assert [one.url for one in right.neighbours] == [left.url, third.url]
    assert f"live page of right: {right.url}\n" in capsys.readouterr().out


def test_one_rig_has_no_links(served, capsys):
    (page,) = served("left")
    assert page.neighbours == []
    assert f"live page: {page.url}\n" in capsys.readouterr().out


def test_a_page_that_fails_ends_all_of_them(served, monkeypatch):
    pages = pytest.importorskip("abs_service.commands.running.pages")
    monkeypatch.setattr(pages.Page, "run", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        served("left", "right")
