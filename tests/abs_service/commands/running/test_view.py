"""`abs-service view`, and `run --view`, without a browser."""

from pathlib import Path

import pytest

from abs_service import config
from abs_service.cli import command_parser, main
from abs_service.commands import run
from abs_service.commands.running import view


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
        (["x.mcap.active"], "x.mcap.active: No such file"),
    ],
)
def test_a_recording_that_cannot_be_shown_is_a_mistake_of_the_user(capsys, arguments, reason):
    pytest.importorskip("viser")
    assert main(["view", *arguments]) == 2
    assert reason in capsys.readouterr().err


@pytest.mark.parametrize("command", ["view", "run"])
def test_without_viser_the_extra_is_named(monkeypatch, capsys, command):
    monkeypatch.setattr(view, "find_spec", lambda _: None)
    assert main([command, *(["--view"] if command == "run" else [])]) == 2
    assert ".venv/bin/pip install -e '.[view]'" in capsys.readouterr().err
