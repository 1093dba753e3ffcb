"""The log of a command, as a process of its own writes it."""

import argparse
import json
import logging
import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import pytest

from abs_service.commands.parts.log import logs
from abs_service.commands.parts.log.log_file import LogFile
from abs_service.display.terminal import output
from abs_service.supervision.exit_codes import Exit
from tests.waiting import eventually

#: A command that logs, and then does what its argument says.
PROGRAM = """
import logging, sys, types
from abs_service import cli
from drivers.contract.device import DeviceError

def act(arguments):
    logging.getLogger("abs_service.act").warning("%d left", 3, extra={"fields": {"left": 3}})
    if arguments.end == "user":
        raise DeviceError("no camera; plug one in")
    if arguments.end == "odd":
        raise DeviceError("no camera \x1b[2J\a–")
    if arguments.end == "mistake":
        raise ZeroDivisionError("one by none")
    return int(arguments.end)

module = types.ModuleType("abs_service.commands.act", "Acts.")
module.add_arguments = lambda parser: parser.add_argument("end")
module.run = act
sys.modules[module.__name__] = module
cli.COMMANDS["act"] = "acts"
sys.exit(cli.main(["act", *sys.argv[1:]]))
"""


def act(*arguments):
    """Exit code and lines of standard error."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", PROGRAM, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    return done.returncode, done.stderr.splitlines()


def test_people_get_text():
    code, (logged, error) = act("user")
    assert code == Exit.USER
    assert logged.endswith("WARNING abs_service.act: 3 left")
    assert error == "abs-service: error: no camera; plug one in"


def test_control_characters_do_not_reach_the_terminal():
    code, (_, error) = act("odd")
    assert code == Exit.USER
    assert error == r"abs-service: error: no camera \x1b[2J\x07–"


def test_programs_get_nothing_but_json():
    code, lines = act("user", "--log-format", "json", "--log-level", "info")
    started, logged, error = map(json.loads, lines)
    assert code == Exit.USER
    assert started["fields"]["arguments"] == ["user", "--log-format", "json", "--log-level", "info"]
    assert (logged["level"], logged["process"], logged["fields"]["left"]) == ("warning", "act", 3)
    assert (error["message"], error["fields"]["exit_code"]) == ("no camera; plug one in", Exit.USER)


def test_our_own_mistakes_are_logged_with_their_traceback():
    code, lines = act("mistake", "--log-format", "json")
    error = json.loads(lines[-1])
    assert code == Exit.FAILED
    assert error["message"].startswith("ZeroDivisionError: ")
    assert "in act" in error["fields"]["exception"]


@pytest.mark.parametrize("form", ["text", "json"])
def test_a_file_gets_everything_and_standard_error_what_ended_the_command(tmp_path, form):
    file = tmp_path / "log"
    for end in ("user", "mistake", "1"):
        code, lines = act(end, "--log-file", file, "--log-format", form)
        assert code == {"user": Exit.USER, "mistake": Exit.FAILED, "1": 1}[end]
        assert not any("left" in line for line in lines)
        assert (lines or [""])[-1] == {
            "user": "abs-service: error: no camera; plug one in",
            "mistake": "ZeroDivisionError: one by none",
            "1": "",
        }[end]
    text = file.read_text()
    assert text.count("3 left") == 3
    assert text.count("no camera") == 1
    assert "in act" in text
    if form == "json":
        assert all(json.loads(line)["process"] == "act" for line in text.splitlines())


def test_a_file_that_cannot_be_written_is_refused(tmp_path):
    code, lines = act("1", "--log-file", tmp_path / "no" / "log")
    assert code == Exit.USER
    assert lines == [f"abs-service: error: --log-file {tmp_path}/no/log: cannot be written: No such file or directory"]


@pytest.fixture
def log_file(tmp_path):
    handler = LogFile(tmp_path / "logs" / "file", delay=True)
    yield handler
    handler.close()


def test_a_log_file_that_is_gone_keeps_no_process_of_run_from_starting_again(tmp_path, monkeypatch, capsys):
    file, kept = tmp_path / "gone" / "log", []
    monkeypatch.setattr(multiprocessing, "parent_process", object)
    monkeypatch.setattr(logging, "basicConfig", lambda level, handlers: kept.extend(handlers))
    arguments = argparse.Namespace(log_file=file, log_format="text", log_level="info")
    logs.set_up(arguments, "track", [])
    (handler,) = kept
    record = logging.LogRecord("x", logging.WARNING, "", 0, "one", None, None)
    handler.emit(record)
    assert eventually(lambda: "cannot be written: No such file or directory" in capsys.readouterr().err)
    handler.close()


def test_a_log_file_that_cannot_be_written_ends_nobody_and_is_told_once(log_file, capsys):
    log, record = logging.Logger("rig"), ("%s", "there")
    log.addHandler(log_file)
    for _ in range(3):
        log.warning(*record)
    path = Path(log_file.baseFilename)
    assert capsys.readouterr().err == f"abs-service: --log-file {path} cannot be written: No such file or directory\n"
    path.parent.mkdir()
    log.warning(*record)
    assert capsys.readouterr().err == f"abs-service: --log-file {path} can be written again, 3 records are missing\n"
    assert path.read_text() == "there\n"


def test_nobody_waits_for_the_reader_of_a_pipe(tmp_path, capsys):
    os.mkfifo(path := tmp_path / "log")
    code, lines = act("1", "--log-file", path)
    assert (code, lines) == (
        2,
        [f"abs-service: error: --log-file {path}: cannot be written: No such device or address"],
    )
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    log, handler = logging.Logger("rig"), LogFile(path)
    log.addHandler(handler)
    for _ in range(100):
        log.warning("x" * 1000)
    assert capsys.readouterr().err.startswith(f"abs-service: --log-file {path} cannot be written: ")
    os.read(reader, 1 << 20)
    log.warning("again")
    assert "can be written again, " in capsys.readouterr().err
    handler.close()
    os.close(reader)


def test_a_full_disk_does_no_more_than_that(capsys):
    log, handler = logging.Logger("rig"), LogFile("/dev/full")
    log.addHandler(handler)
    for _ in range(3):
        log.warning("there")
    assert capsys.readouterr().err == "abs-service: --log-file /dev/full cannot be written: No space left on device\n"
    with pytest.raises(OSError, match="No space"):
        handler.close()


def test_a_live_process_waits_for_no_reader_of_its_log(monkeypatch):
    reader, writer = os.pipe()
    monkeypatch.setattr(output, "END_S", 0.05)
    with os.fdopen(writer, "w") as stderr:
        monkeypatch.setattr(sys, "stderr", stderr)
        handler = logging.StreamHandler(stderr)
        monkeypatch.setattr(logging.getLogger(), "handlers", [handler])
        with logs.in_background():
            for _ in range(3):
                logging.warning("x" * 40_000)  # a pipe holds 64 KiB
            assert os.read(reader, 10) == b"x" * 10
        assert handler.stream is stderr
        os.close(reader)
