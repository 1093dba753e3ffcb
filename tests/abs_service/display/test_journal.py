"""Entries of the journal, received by a socket that is read as journald reads its own."""

import os
import socket
import sys
from functools import partial

import pytest
from absmsg.v1.health_pb2 import Health

from abs_service.bus.contract import Sample
from abs_service.display.terminal import choice, journal
from abs_service.supervision.children.child import Child, ChildState
from abs_service.supervision.health.rig_state import RigState
from abs_service.supervision.health.rig_view import RigPlaces, RigView
from abs_service.supervision.process_setup import log_lines
from abs_service.tracking.log.tracker_log import EstimateReport

S = 1_000_000_000


def decoded(datagram):
    """The fields of an entry, see "Journal Native Protocol" of systemd."""
    fields = {}
    while datagram:
        line, _, datagram = datagram.partition(b"\n")
        name, equals, value = line.partition(b"=")
        if not equals:
            size = int.from_bytes(datagram[:8], "little")
            value, datagram = datagram[8 : 8 + size], datagram[9 + size :]
        fields[name.decode()] = value.decode()
    return fields


class Journal:
    """A journal, and a rig that writes to it, whose state is in the test's hand."""

    def __init__(self, folder):
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._socket.bind(str(folder / "socket"))
        self.display = journal.JournalDisplay(partial(journal.send, address=str(folder / "socket")))
        self.live = RigState(["sheet"], lambda: 0)
        self.child = Child("track/sheet", (), 1, ChildState.RUNNING)

    def health(self, component, level, message=""):
        health = Health(component=component, level=level, message=message)
        self.live.take(Sample(f"health/{component}", Health.DESCRIPTOR.full_name, health.SerializeToString()))

    def status(self, status, *reasons):
        report = EstimateReport("sheet", 1, "", status, reasons, (), (), None, None, None, 1.0, 1.0, 1, 1, 0)
        self.live.trackers["sheet"].last = report

    def view(self, second):
        return RigView(RigPlaces("lab"), self.live, [self.child], second, int(second * S), "")

    def entries(self, second=0.0):
        """Journal entries written at this time of the rig, without the fields that all entries share."""
        self.display.update(self.view(second))
        return list(self._read())

    def _read(self):
        while True:
            try:
                fields = decoded(self._socket.recv(65536))
            except BlockingIOError:
                return
            assert (fields.pop("SYSLOG_IDENTIFIER"), fields.pop("ABS_RIG")) == ("abs-service", "lab")
            yield fields

    def close(self):
        self._socket.close()


@pytest.fixture
def written(tmp_path):
    one = Journal(tmp_path)
    yield one
    one.close()


def test_changes_are_written_once_with_fields_to_search_by(written):
    written.health("capture", Health.LEVEL_OK)
    written.status("TRACKING")
    assert [entry["MESSAGE"] for entry in written.entries()] == [
        "capture: ok", "track/sheet: TRACKING", "track/sheet: running",
    ]  # fmt: skip
    assert written.entries(1.0) == []
    written.health("capture", Health.LEVEL_ERROR, "sim: is unplugged; plug it in")
    written.status("LOST", "no frame", "nothing seen")
    written.child.state, written.child.reason = ChildState.BACKOFF, "ended by signal 9"
    fields = [tuple(entry.items()) for entry in written.entries(2.0)]
    assert [entry[0][1] for entry in fields] == [
        "capture: error: sim: is unplugged; plug it in",
        "track/sheet: LOST: no frame; nothing seen",
        "track/sheet: backoff: ended by signal 9",
    ]
    assert [entry[1:] for entry in fields] == [
        (("PRIORITY", "3"), ("ABS_COMPONENT", "capture"), ("ABS_LEVEL", "error")),
        (("PRIORITY", "6"), ("ABS_COMPONENT", "track/sheet"), ("ABS_STATUS", "LOST")),
        (("PRIORITY", "6"), ("ABS_COMPONENT", "track/sheet"), ("ABS_STATE", "backoff")),
    ]


def test_a_status_that_flickers_is_written_once_a_second_at_most(written):
    written.entries()
    found = []
    for frame in range(90):
        written.status("TRACKING" if frame % 2 else "DEGRADED")
        found += written.entries(1 + frame / 30)
    assert 1 <= len(found) <= 3


def test_a_message_whose_numbers_change_is_written_once(written):
    written.health("run", Health.LEVEL_ERROR, "no estimate for 3 s")
    assert written.entries()[0]["PRIORITY"] == "3"
    written.health("run", Health.LEVEL_ERROR, "no estimate for 4 s")
    assert written.entries(1.0) == []


def test_notes_and_the_summary_keep_their_lines(written):
    written.entries()
    written.display.note("record: a = b\nTraceback:\n  é")
    assert written.entries()[0] == {"MESSAGE": "record: a = b\nTraceback:\n  é", "PRIORITY": "6"}
    written.display.close(written.view(5.0))
    assert written.entries()[0]["MESSAGE"].startswith("5.0 s, 0 images, 0 dropped\nsheet: 0 estimates")


def test_records_of_a_log_keep_level_process_and_traceback(written):
    written.entries()
    written.display.note(log_lines.line(0.0, "warning", "track/sheet", "kernels are stale", {}))
    written.display.note(log_lines.line(0.0, "critical", "record", "ValueError: x", {"exception": "Traceback:\n  y"}))
    assert written.entries() == [
        {"MESSAGE": "kernels are stale", "PRIORITY": "4", "ABS_COMPONENT": "track/sheet"},
        {"MESSAGE": "ValueError: x\nTraceback:\n  y", "PRIORITY": "2", "ABS_COMPONENT": "record"},
    ]


def test_without_a_journal_the_message_is_kept(tmp_path, capsys):
    journal.send({"MESSAGE": "it ended", "PRIORITY": "3"}, address=str(tmp_path / "nobody"))
    assert capsys.readouterr().err == "it ended\n"


def test_run_writes_to_the_journal_if_systemd_has_connected_it(tmp_path, monkeypatch):
    with (tmp_path / "stream").open("w") as stream:
        monkeypatch.setattr(sys, "stderr", stream)
        status = os.fstat(stream.fileno())
        monkeypatch.setenv("JOURNAL_STREAM", f"{status.st_dev}:{status.st_ino}")
        with choice.shown(as_json=False) as display:
            assert isinstance(display, journal.JournalDisplay)
        # Inherited by a shell that has sent its output elsewhere.
        monkeypatch.setenv("JOURNAL_STREAM", f"{status.st_dev}:{status.st_ino + 1}")
        with choice.shown(as_json=False) as display:
            assert not isinstance(display, journal.JournalDisplay)
