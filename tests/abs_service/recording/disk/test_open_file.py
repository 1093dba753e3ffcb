"""The recorder and what others do to the file that it writes."""

import errno
import fcntl
import os

import pytest

from drivers.encoding.mcap_file import Compression
from tests.abs_service.recording.recorder_rig import Rig, depth, metadata, sequences
from tests.waiting import eventually


@pytest.mark.parametrize("event", ["deleted", "moved"])
def test_an_open_file_that_is_taken_away_is_noticed_and_another_one_begun(tmp_path, event):
    folder, elsewhere = tmp_path / "kept", tmp_path / "elsewhere"
    rig = Rig(folder, flush_s=0.005)
    rig.recorder.start()
    rig.publish_image(depth(1))
    assert eventually(lambda: rig.written(1))
    (active,) = folder.glob("*.active")
    if event == "deleted":
        active.unlink()
    else:
        folder.rename(elsewhere)
    assert eventually(lambda: rig.recorder.failures == 1)
    name = active.name.removesuffix(".active")
    assert rig.said.labels["last_failure"] == f"{name} was {event} while it was written"
    rig.publish_image(depth(2))
    assert eventually(lambda: not rig.recorder.failed)
    rig.recorder.stop(5)
    assert sequences(folder) == [2]
    if event == "moved":  # complete where it is now
        assert metadata(elsewhere / name)["ended"] == "gone"
        assert sequences(elsewhere) == [1]


@pytest.mark.parametrize("change", [b"", b"half", b"more"])
def test_a_file_that_another_program_changes_is_noticed_and_does_not_look_complete(tmp_path, change):
    rig = Rig(tmp_path, compression=Compression.NONE, flush_s=0.005)
    rig.recorder.start()
    for seq in range(20):
        rig.publish_image(depth(seq))
    assert eventually(lambda: rig.written(20))
    (active,) = tmp_path.glob("*.active")
    assert eventually(lambda: active.stat().st_size > 20_000)
    if change == b"more":
        with active.open("ab") as stream:
            stream.write(change)
    else:
        os.truncate(active, 500 * len(change))
    rig.publish_image(depth(20))
    assert eventually(lambda: rig.recorder.failures == 1)
    name = active.name.removesuffix(".active")
    assert rig.said.labels["last_failure"] == f"{name} was changed by another program while it was written"
    rig.publish_image(depth(21))
    assert eventually(lambda: not rig.recorder.failed)
    rig.recorder.stop(5)
    assert active.exists()
    assert sequences(tmp_path)[-1:] == [21]


@pytest.mark.parametrize("code", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_a_file_system_without_locks_is_said_with_the_remedy(tmp_path, monkeypatch, code):
    """NFS without its lock service, network drives, Lustre: "[Errno 37] No locks available" told nobody what to do."""

    def refuse(stream, operation):
        raise OSError(code, os.strerror(code))

    rig = Rig(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(fcntl, "flock", refuse)
        rig.recorder.start()
        rig.publish_image(depth(0))
        assert eventually(lambda: rig.recorder.failed)
        assert f"{tmp_path} is on a file system without locks ({os.strerror(code)}): mount it" in rig.said.message
    assert eventually(lambda: not rig.recorder.failed)
    rig.recorder.stop(5)
    assert sequences(tmp_path) == [0]
