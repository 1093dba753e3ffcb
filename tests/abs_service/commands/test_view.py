"""`abs-service view`, and `run --view`, without a browser."""

from pathlib import Path

import pytest

from abs_service import config
from abs_service.cli import main
from abs_service.commands import run, view


def test_run_serves_a_page_only_if_asked():
    rig = config.load_default()
    components = [[child.component for child in run.children(rig, Path("rig.toml"), page)] for page in (False, True)]
    assert components == [["capture", "track/sheet", "record"], ["capture", "track/sheet", "record", "view"]]


@pytest.mark.parametrize("command", ["view", "run"])
def test_without_viser_the_extra_is_named(monkeypatch, capsys, command):
    monkeypatch.setattr(view, "find_spec", lambda _: None)
    assert main([command, *(["--view"] if command == "run" else [])]) == 2
    assert "pip install 'abs-service[view]'" in capsys.readouterr().err
