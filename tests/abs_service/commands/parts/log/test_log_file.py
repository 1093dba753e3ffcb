"""Records of a log whose disk stands still wait in a thread, as many as memory is to hold."""

import logging
import threading

import pytest

from abs_service.commands.parts.log import log_file
from abs_service.commands.parts.log.log_file import InBackground, LogFile
from tests.waiting import eventually


class Stuck(LogFile):
    """A file whose disk stands still until a test lets it go on."""

    answers, begun = threading.Event(), threading.Event()

    def emit(self, record):
        self.begun.set()
        self.answers.wait()
        super().emit(record)


def log(handler, number):
    for index in range(number):
        handler.handle(logging.LogRecord("abs", logging.INFO, __file__, 1, "%d", (index,), None))


@pytest.fixture
def stuck(tmp_path, monkeypatch):
    """Makes a file whose disk stands still, and what writes to it; one record has been begun."""

    def make():
        monkeypatch.setattr(Stuck, "answers", threading.Event())
        monkeypatch.setattr(Stuck, "begun", threading.Event())
        file = Stuck(tmp_path / "log", encoding="utf-8")
        handler = InBackground(file)
        log(handler, 1)
        assert file.begun.wait(5)
        return file, handler

    return make


def test_nobody_waits_and_what_memory_does_not_hold_is_told(tmp_path, capsys, monkeypatch, stuck):
    monkeypatch.setattr(log_file, "WAITING", 10)
    file, handler = stuck()
    log(handler, 12)
    assert capsys.readouterr().err == f"abs-service: --log-file {tmp_path}/log cannot be written: it stands still\n"
    Stuck.answers.set()
    assert eventually(lambda: (tmp_path / "log").read_text().count("\n") == 11)
    handler.close()
    assert capsys.readouterr().err.endswith("can be written again, 2 records are missing\n")
    file.close()


def test_a_process_that_ends_does_not_wait_for_long(tmp_path, capsys, monkeypatch, stuck):
    monkeypatch.setattr(log_file, "END_S", 0.05)
    file, handler = stuck()
    log(handler, 2)
    handler.close()
    assert not Stuck.answers.is_set()  # the file still stands still
    assert capsys.readouterr().err.endswith("it stands still, 3 records are missing\n")
    Stuck.answers.set()
    assert eventually(lambda: (tmp_path / "log").read_text().count("\n") == 3)
    file.close()


def test_the_end_waits_until_all_is_written(tmp_path):
    file = LogFile(tmp_path / "log", encoding="utf-8")
    handler = InBackground(file)
    log(handler, 500)
    handler.close()
    assert (tmp_path / "log").read_text().split() == [str(index) for index in range(500)]
    file.close()
