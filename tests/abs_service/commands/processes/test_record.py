"""A recorder that starts says what it cannot recover."""

import errno
import logging
import os
import shutil
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from abs_service import config
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.processes import record
from abs_service.recording import recovery
from abs_service.recording.recorder_settings import RecorderSettings
from abs_service.recording.recording_file import RecordingFile
from calib.files import limited
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.waiting import eventually

#: When the recorder begins: after all that the tests have made.
LATER_S = time.time() + 3600


def test_an_unfinished_recording_that_holds_nothing_is_told(tmp_path, caplog):
    health = Health(LoopbackBus(), "record", HeaderFactory("demo", WallClock()))
    (tmp_path / "a.mcap.active").write_bytes(b"no recording")
    settings = RecorderSettings(tmp_path, "demo", "", minimum_free_bytes=0)
    with caplog.at_level(logging.WARNING):
        record.recover_leftovers(settings, health, LATER_S)
    assert [record.getMessage() for record in caplog.records] == [
        f"not recovered: {tmp_path}/a.mcap.active: holds no MCAP record"
    ]
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap.broken"], "which retention may delete"


@pytest.mark.parametrize("number", [errno.EACCES, errno.EIO, errno.EMFILE])
def test_an_unfinished_recording_that_cannot_be_opened_now_stays_for_later(tmp_path, monkeypatch, number):
    """Of another user, say. Set aside as one that holds nothing, retention would delete it."""
    bus = LoopbackBus()
    health = Health(bus, "record", HeaderFactory("demo", WallClock()))
    settings = RecorderSettings(tmp_path, "demo", "", minimum_free_bytes=0)
    RecordingFile(tmp_path / "a.mcap", 0, {}).abandon()
    refuses = OSError(number, os.strerror(number))
    monkeypatch.setattr(limited, "open", lambda *_, **__: (_ for _ in ()).throw(refuses), raising=False)
    assert not record.recover_leftovers(settings, health, LATER_S)
    assert health_now(health, bus).message == f"{tmp_path}/a.mcap.active cannot be recovered: {os.strerror(number)}"
    monkeypatch.undo()
    assert record.recover_leftovers(settings, health, LATER_S)
    assert not health_now(health, bus).message
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_a_recording_in_a_folder_where_owners_alone_may_delete_is_copied_once(tmp_path, monkeypatch):
    """As /tmp is: it was copied again every ten seconds."""
    health = Health(LoopbackBus(), "record", HeaderFactory("demo", WallClock()))
    settings = RecorderSettings(tmp_path, "demo", "", minimum_free_bytes=0)
    RecordingFile(tmp_path / "a.mcap", 0, {}).abandon()

    def refuse(*_):
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    def replace(source, target, rename=os.replace):
        return refuse() if Path(target).suffix == ".active" else rename(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", replace)
        patch.setattr(Path, "unlink", refuse)
        assert not record.recover_leftovers(settings, health, LATER_S)
        copy = (tmp_path / "a.mcap").stat()
        patch.setattr(recovery, "set_aside", refuse)
        patch.setattr(record, "set_aside", refuse)
        assert not record.recover_leftovers(settings, health, LATER_S)
    assert (tmp_path / "a.mcap").stat() == copy
    assert record.recover_leftovers(settings, health, LATER_S)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "a.mcap.broken"]


def test_what_is_being_recorded_is_nothing_to_recover(tmp_path, caplog):
    mine = RecordingFile(tmp_path / "a.mcap", 0, {})
    health = Health(LoopbackBus(), "record", HeaderFactory("demo", WallClock()))
    with caplog.at_level("WARNING"):
        record.recover_leftovers(RecorderSettings(tmp_path, "demo", "", minimum_free_bytes=0), health, LATER_S)
    mine.finish({})
    assert (caplog.records, [path.name for path in tmp_path.iterdir()]) == ([], ["a.mcap"])


def test_a_file_that_a_recorder_has_made_this_moment_stays(tmp_path):
    """It is locked a moment later; whoever takes it for a leftover in between ends that recording."""
    (tmp_path / "a.mcap.active").touch()
    (tmp_path / "b.mcap.active").write_bytes(b"no recording")
    health = Health(LoopbackBus(), "record", HeaderFactory("demo", WallClock()))
    settings = RecorderSettings(tmp_path, "demo", "", minimum_free_bytes=0)
    record.recover_leftovers(settings, health, time.time() - 3600)  # both are newer than the recorder
    tick_s = (tmp_path / "b.mcap.active").stat().st_mtime + 0.01  # the file system's clock is behind by as much
    record.recover_leftovers(settings, health, tick_s)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap.active", "b.mcap.active"]
    record.recover_leftovers(settings, health, LATER_S)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap.active", "b.mcap.broken"]


def test_what_was_left_before_the_wall_clock_was_set_back_is_recovered(tmp_path):
    """After a power cut, a host without a battery for its clock starts in the past."""
    RecordingFile(tmp_path / "a.mcap", 0, {}).abandon()
    later_s = time.time() + 3600
    os.utime(tmp_path / "a.mcap.active", (later_s, later_s))
    health = Health(LoopbackBus(), "record", HeaderFactory("demo", WallClock()))
    record.recover_leftovers(RecorderSettings(tmp_path, "demo", "", minimum_free_bytes=0), health, time.time())
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


@pytest.mark.parametrize(("age_s", "goes_on"), [(30, True), (90, False), (-90, False)])
def test_a_recorder_goes_on_with_what_was_interrupted_within_a_minute(tmp_path, age_s, goes_on):
    RecordingFile(tmp_path / "a.mcap", 0, {}).abandon()
    changed_s = time.time() - age_s
    os.utime(tmp_path / "a.mcap.active", (changed_s, changed_s))
    rig = config.load_default()
    table = rig.record.model_copy(update={"directory": tmp_path, "when": "requested"})
    trigger = record.make_trigger(rig.model_copy(update={"record": table}), WallClock())
    assert bool(trigger.reason) == goes_on


def test_what_a_failing_disk_leaves_is_recovered_when_there_is_room_without_another_start(tmp_path, monkeypatch):
    free = [0]
    monkeypatch.setattr(record, "RECOVERY_S", 0.01)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=free[0]))
    bus = LoopbackBus()
    health = Health(bus, "record", HeaderFactory("demo", WallClock()))
    recorder, stop = SimpleNamespace(failures=0, failed=""), threading.Event()
    context = recorder, RecorderSettings(tmp_path, "demo", ""), health, stop, time.time()
    thread = threading.Thread(target=record.recover_again_and_again, args=context)
    thread.start()
    RecordingFile(tmp_path / "a.mcap", 0, {}).abandon()
    os.utime(tmp_path / "a.mcap.active", (1e9, 1e9))
    recorder.failed, recorder.failures = "the disk is full", 1  # in this order: the thread looks at any moment
    assert not eventually(lambda: "recovered" in health_now(health, bus).message, 0.1)
    recorder.failed = ""
    assert eventually(lambda: health_now(health, bus).message.endswith("cannot be recovered: No space left on device"))
    free[0] = 1 << 40
    assert eventually((tmp_path / "a.mcap").exists)
    assert eventually(lambda: not health_now(health, bus).message)
    stop.set()
    thread.join()
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]
