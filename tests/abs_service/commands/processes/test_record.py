"""A recorder that starts says what it cannot recover."""

import logging
import time

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.processes import record
from abs_service.recording.recorder_settings import RecorderSettings
from abs_service.recording.recording_file import RecordingFile
from tests.abs_service.bus.loopback import LoopbackBus

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
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap.active", "b.mcap.active"]
    record.recover_leftovers(settings, health, LATER_S)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap.active", "b.mcap.broken"]
