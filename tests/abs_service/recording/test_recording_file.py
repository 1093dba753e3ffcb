"""The file of a recording on disk."""

import errno
import fcntl
import os

import pytest

from abs_service.recording.recording_file import RecordingFile
from abs_service.recording.recovery import InUseError, recover
from drivers.encoding.mcap_file import Compression
from drivers.replay.contents import Topic, scan
from tests.abs_service.recording.test_recovery import FRAMES, write

SCHEMA, SIZE = "absmsg.v1.Health", 1 << 20


def is_in_memory(path, size):
    """True if the system can give the bytes of a file without its disk."""
    with path.open("rb", buffering=0) as stream:
        try:
            return os.preadv(stream.fileno(), [bytearray(size)], 0, os.RWF_NOWAIT) == size
        except BlockingIOError:
            return False
        except OSError:
            return pytest.skip("the file system does not say what is in memory")


@pytest.fixture
def folder(tmp_path):
    """A folder of a file system on a disk."""
    path = tmp_path / "sample"
    with path.open("wb") as stream:
        stream.write(bytes(SIZE))
        stream.flush()
        os.fdatasync(stream.fileno())
        os.posix_fadvise(stream.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    if is_in_memory(path, SIZE):
        pytest.skip("the file system keeps its files in memory")
    return tmp_path


def test_what_was_flushed_leaves_the_memory_to_others(folder):
    file = RecordingFile(folder / "a.mcap", 1, {}, Compression.NONE, chunk_size=1 << 16)
    active = folder / "a.mcap.active"
    file.write("health/a", SCHEMA, bytes(SIZE), 1, 1)
    assert is_in_memory(active, SIZE)
    file.flush()
    assert not is_in_memory(active, SIZE)
    assert file.finish({}).stat().st_size > SIZE


def test_on_nfs_a_file_that_is_only_read_can_be_locked_as_well(tmp_path, monkeypatch):
    """An exclusive lock needs a file that is open for writing there: what a crash left was never recovered."""
    real = fcntl.flock

    def of_nfs(stream, operation):
        if operation & fcntl.LOCK_EX and fcntl.fcntl(stream, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        real(stream, operation)

    monkeypatch.setattr(fcntl, "flock", of_nfs)
    source = write(tmp_path / "a.mcap.active", finish=False)
    with source.open("ab") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        with pytest.raises(InUseError):
            recover(source)
    assert recover(source).messages == 2 * FRAMES


def test_an_overwritten_beginning_costs_what_was_there(tmp_path):
    """The names of the channels are there, too; without them no message of the rest would be known."""
    file = RecordingFile(tmp_path / "a.mcap", 1, {}, Compression.NONE)
    for number in range(1, 5):
        file.write("health/a", SCHEMA, bytes(150_000), number, number)
        file.flush()
    active = file.abandon()
    active.write_bytes(bytes(100_000) + active.read_bytes()[100_000:])
    report = recover(active)
    assert (report.messages, report.orphans) == (3, 0)
    assert list(scan(report.target).topics.values()) == [Topic("/health/a", SCHEMA, 3)]
