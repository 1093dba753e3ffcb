"""Commands return the exit codes that docs/reference/command-line.md lists."""

import multiprocessing
import os
import re
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from unittest.mock import Mock

import pytest

from abs_service import cli
from abs_service.__main__ import start
from abs_service.commands import check
from abs_service.commands.running import reinitialize
from abs_service.supervision.exit_codes import Exit

ROOT = Path(__file__).parents[3]

PAGE = (Path(__file__).parents[3] / "docs" / "reference" / "command-line.md").read_text(encoding="utf-8")


def listed():
    section = PAGE.partition("## Exit codes")[2].partition("\n## ")[0]
    return {int(code) for code in re.findall(r"^\| (\d+) \|", section, re.MULTILINE)}


def test_the_page_lists_every_code():
    assert listed() == {*Exit, 128 + signal.SIGTERM}


def test_0_for_what_is_done():
    assert cli.main(["check"]) == Exit.OK


def test_1_for_what_did_not_happen(endpoint, monkeypatch):
    monkeypatch.setattr(reinitialize, "TIMEOUT_S", 0.1)
    assert cli.main(["reinitialize", "--listen", endpoint]) == Exit.FAILED


def test_2_for_what_has_to_be_changed(tmp_path):
    assert cli.main(["check", str(tmp_path / "none.toml")]) == Exit.USER


@pytest.mark.parametrize("command", [("run", "--duration"), ("devices", "--timeout")])
@pytest.mark.parametrize("text", ["nan", "-1", "soon"])
def test_2_for_a_time_that_is_none(command, text, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main([*command, text])
    assert ended.value.code == Exit.USER
    assert f"{command[1]}: {text!r} must be a number of seconds, 0 or more" in capsys.readouterr().err


def test_130_for_ctrl_c_while_a_command_is_imported(monkeypatch, capsys):
    monkeypatch.setattr(cli, "import_module", Mock(side_effect=KeyboardInterrupt))
    monkeypatch.setattr(cli.threading, "enumerate", list)
    with pytest.raises(SystemExit) as ended:
        cli.program()
    assert (ended.value.code, capsys.readouterr().err) == (Exit.INTERRUPTED, "")


def test_130_for_ctrl_c_while_the_command_line_is_imported(monkeypatch):
    importer = Mock(find_spec=Mock(side_effect=KeyboardInterrupt))
    monkeypatch.setattr(sys, "meta_path", [importer])
    monkeypatch.delitem(sys.modules, "abs_service.cli")
    with pytest.raises(SystemExit) as ended:
        start()
    assert ended.value.code == Exit.INTERRUPTED


def test_the_first_process_of_a_container_ends_by_sigterm_while_the_command_line_is_imported(monkeypatch):
    before = signal.getsignal(signal.SIGTERM)
    ends = Mock(side_effect=SystemExit)
    monkeypatch.setattr(os, "_exit", ends)
    monkeypatch.setattr(os, "getpid", lambda: 1)
    importer = Mock(find_spec=lambda *_: signal.raise_signal(signal.SIGTERM))
    monkeypatch.setattr(sys, "meta_path", [importer])
    monkeypatch.delitem(sys.modules, "abs_service.cli")
    try:
        with pytest.raises(SystemExit):
            start()
    finally:
        signal.signal(signal.SIGTERM, before)
    ends.assert_called_once_with(128 + signal.SIGTERM)


def test_130_for_ctrl_c_in_a_native_import_which_would_make_a_failure_of_its_own_of_an_exception(monkeypatch):
    ends = Mock(side_effect=SystemExit)
    monkeypatch.setattr(os, "_exit", ends)
    interrupted = {"abs_service.commands.check": lambda name: signal.raise_signal(signal.SIGINT)}
    monkeypatch.setattr(cli, "import_module", lambda name: interrupted.get(name, import_module)(name))
    with pytest.raises(SystemExit):
        cli.main(["check"])
    ends.assert_called_once_with(Exit.INTERRUPTED)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_130_for_ctrl_c(monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(check, "describe", interrupted)
    assert cli.main(["check"]) == Exit.INTERRUPTED


@pytest.mark.parametrize("buffered", [True, False])
@pytest.mark.parametrize("command", [("check",), ("info", "recordings/sample.mcap"), ("devices", "--timeout", "0.1")])
def test_141_for_a_reader_that_is_gone(command, buffered):
    reader, writer = os.pipe()
    os.close(reader)
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    environment = kept | {"PYTHONPATH": os.pathsep.join(sys.path)} | ({} if buffered else {"PYTHONUNBUFFERED": "1"})
    started = [sys.executable, "-m", "abs_service", *command]
    done = subprocess.run(started, cwd=ROOT, stdout=writer, stderr=subprocess.PIPE, env=environment, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (Exit.PIPE_CLOSED, b"")


def test_143_for_a_second_sigterm():
    program = (
        "import os, signal\nfrom abs_service.commands.parts import rig_process\nrig_process.stop_on_signals()\n"
        "for _ in range(2):\n    os.kill(os.getpid(), signal.SIGTERM)"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", program], env=environment, check=False)
    assert done.returncode == 128 + signal.SIGTERM


@pytest.mark.parametrize(("ignored", "reported"), [(False, True), (True, False)])
def test_a_terminal_that_is_closed_ends_in_order_unless_nohup_is_used(ignored, reported):
    program = (
        "import os, signal, sys\nfrom abs_service.commands.parts import rig_process\n"
        f"signal.signal(signal.SIGHUP, signal.{'SIG_IGN' if ignored else 'SIG_DFL'})\n"
        "stop = rig_process.stop_on_signals()\n"
        "for _ in range(2):\n    os.kill(os.getpid(), signal.SIGHUP)\n"
        "sys.exit(10 + stop.wait(0.2))"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", program], env=environment, check=False)
    assert done.returncode == 10 + reported


def test_a_process_that_not_even_sigkill_ends_does_not_keep_this_one(monkeypatch, capsys):
    record = Mock()
    record.name = "record"
    monkeypatch.setattr(multiprocessing, "active_children", lambda: [record])
    monkeypatch.setattr(cli, "main", lambda: Exit.FAILED)
    monkeypatch.setattr(os, "_exit", Mock(side_effect=SystemExit("at once")))
    monkeypatch.setattr(sys, "argv", ["abs-service", "check"])
    with pytest.raises(SystemExit, match="at once"):
        cli.program()
    assert "left behind, since they do not end: record" in capsys.readouterr().err
