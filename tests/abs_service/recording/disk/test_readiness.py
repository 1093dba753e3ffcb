"""A recorder that waits for its trigger tells whether it could record, and when it can again."""

import os
from types import SimpleNamespace

import pytest
from absmsg.v1.health_pb2 import Health

from abs_service.recording.disk import folder, readiness
from abs_service.recording.triggers.trigger import RequestTrigger
from tests.abs_service.recording.recorder_rig import Rig, depth, recordings, sequences
from tests.waiting import eventually


@pytest.fixture
def waiting(tmp_path, monkeypatch):
    """Makes a rig whose recorder waits for a trigger; arguments of `Rig`."""
    monkeypatch.setattr(readiness, "POLL_NS", 10**6)
    made = []

    def make(**arguments):
        rig = Rig(tmp_path / "takes", trigger=RequestTrigger(False, 1.0, lambda: 0), pre_roll_s=2.0, **arguments)
        made.append(rig)
        rig.recorder.start()
        return rig

    yield make
    for rig in made:
        rig.recorder.stop(5)


@pytest.mark.parametrize("fault", ["full", "no inode", "no folder", "unmounted"])
def test_what_a_recording_would_fail_of_is_said_before_it_is_asked_for(waiting, tmp_path, monkeypatch, fault):
    free = [1 << 40]
    rig = waiting(free_bytes=lambda _: free[0], minimum_free_bytes=1000)
    assert eventually((tmp_path / "takes").is_dir)
    assert rig.said.level == Health.LEVEL_OK
    if fault == "full":
        free[0] = 999
    elif fault == "no inode":
        monkeypatch.setattr(os, "statvfs", lambda _: SimpleNamespace(f_files=1000, f_favail=0))
    elif fault == "no folder":
        (tmp_path / "takes").rmdir()
        (tmp_path / "takes").write_text("")
    else:
        monkeypatch.setattr(folder, "check_mounted", unmounted)
    assert eventually(lambda: rig.said.level == Health.LEVEL_ERROR)
    assert rig.said.message.startswith("nothing could be recorded: ")
    assert ("no inode is left on the disk of" in rig.said.message) == (fault == "no inode")
    free[0] = 1 << 40
    monkeypatch.undo()
    if fault == "no folder":
        (tmp_path / "takes").unlink()
    assert eventually(lambda: rig.said.level == Health.LEVEL_OK)
    assert not rig.recorder.failures  # nothing was lost


def test_a_failure_is_over_when_the_disk_takes_recordings_again_though_nothing_is_to_be_recorded(waiting, monkeypatch):
    monkeypatch.setattr(folder, "takes", lambda _: works[0])
    works = [False]
    rig = waiting(open_file=refused, queue_bytes=0)
    assert not rig.recorder.ask(True)
    assert eventually(lambda: rig.recorder.failed)
    assert not rig.recorder.ask(False)
    assert rig.said.message == "RECORD_FAILED [Errno 28] No space left on device"
    works[0] = True
    assert eventually(lambda: rig.said.level == Health.LEVEL_OK)
    assert rig.recorder.failures == 1


def test_a_short_recording_that_is_complete_ends_a_failure(waiting, tmp_path, monkeypatch):
    monkeypatch.setattr(folder, "takes", lambda _: False)
    (tmp_path / "takes").write_text("")
    rig = waiting(flush_s=60.0, pre_roll_bytes=1 << 20)
    rig.publish_image(depth(1))
    assert not rig.recorder.ask(True)
    assert eventually(lambda: rig.recorder.failed)
    assert not rig.recorder.ask(False)
    (tmp_path / "takes").unlink()
    assert eventually(lambda: recordings(tmp_path / "takes"))
    assert eventually(lambda: rig.said.level == Health.LEVEL_OK)
    assert sequences(tmp_path / "takes") == [1]


def unmounted(mount):
    raise OSError(f"the disk at {mount} is not mounted any more")


def refused(path):
    raise OSError(28, "No space left on device")
