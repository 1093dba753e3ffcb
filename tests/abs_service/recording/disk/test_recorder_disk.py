"""The recorder with a disk that is slow, nearly full, full or missing."""

import os
import queue
import stat
import threading

from absmsg.v1.health_pb2 import Health

from abs_service.recording.recovery import recover
from drivers.encoding.mcap_file import Compression
from tests.abs_service.recording.recorder_rig import DEPTH, RETRY_S, Rig, depth, metadata, read, recordings, sequences
from tests.waiting import eventually


class SlowFile:
    """A disk that takes nothing until it is released."""

    def __init__(self, path):
        self._file = path.open("xb")
        self.entered, self.release = queue.SimpleQueue(), threading.Event()
        self.release.set()

    def write(self, data):
        if not self.release.is_set():
            self.entered.put(None)
            self.release.wait()
        return self._file.write(data)

    def __getattr__(self, name):
        return getattr(self._file, name)


def test_a_slow_disk_costs_a_bounded_queue_and_every_drop_is_counted(tmp_path):
    files = []

    def slow(path):
        files.append(SlowFile(path))
        return files[-1]

    rig = Rig(tmp_path, open_file=slow, queue_bytes=20_000, flush_s=0.01)
    rig.recorder.start()
    while not files:
        threading.Event().wait(0.001)
    files[0].release.clear()
    rig.publish_image(depth(0))
    files[0].entered.get(timeout=5)
    for seq in range(1, 101):
        rig.publish_image(depth(seq))
    files[0].release.set()
    rig.recorder.stop(5)
    rig.recorder.report()
    said = rig.said
    dropped = said.counters[f"dropped.{DEPTH}"]
    assert 80 < dropped < 100
    assert said.message == f"the disk is too slow: {dropped} messages dropped"
    (path,) = recordings(tmp_path)
    written = [m for m in read(path)[0] if m.channel.topic == f"/{DEPTH}"]
    assert len(written) + dropped == 101
    assert metadata(path)[f"dropped.{DEPTH}"] == str(dropped)


def test_it_stops_before_the_disk_is_full_with_a_complete_file_and_resumes_when_there_is_room(tmp_path):
    free = [10**9]
    rig = Rig(tmp_path, free_bytes=lambda folder: free[0], minimum_free_bytes=1000, flush_s=0.005)
    rig.recorder.start()
    rig.publish_image(depth(1))
    assert eventually(lambda: rig.written(1))
    free[0] = 999
    assert eventually(lambda: rig.recorder.failed)
    assert rig.recorder.failed == (
        f"only 0 MB free in {tmp_path}, record.minimum_free_bytes is 0 MB; recording resumes with 0 MB"
    )
    assert rig.said.message.startswith("RECORD_FAILED only 0 MB free")
    (path,) = recordings(tmp_path)
    assert metadata(path)["ended"] == "low space"
    free[0] = 1400  # not enough: it would be full again at once
    threading.Event().wait(3 * RETRY_S)
    assert rig.recorder.failed
    rig.publish_image(depth(2))  # waits in the queue
    free[0] = 2000
    assert eventually(lambda: not rig.recorder.failed)
    assert rig.said.level == Health.LEVEL_OK
    rig.recorder.stop(5)
    assert [rig.recorder.failures, rig.said.counters["failures"]] == [1, 1]
    assert sequences(tmp_path) == [1, 2]


def test_what_has_waited_in_memory_does_not_fill_the_disk_and_files_keep_their_size(tmp_path):
    open_now = threading.Event()
    settings = {"compression": Compression.NONE, "chunk_bytes": 2000, "minimum_free_bytes": 30_000, "flush_s": 60}

    def free(folder):
        return 150_000 - sum(path.stat().st_size for path in folder.iterdir())

    def slow(path):
        open_now.wait()
        return path.open("xb", buffering=4096)  # sizes tell what was written; from Python 3.14 on, 128 kB may wait

    rig = Rig(tmp_path, free_bytes=free, open_file=slow, rotate_bytes=50_000, **settings)
    rig.recorder.start()
    for seq in range(100):  # 1.5 kB each
        rig.publish_image(depth(seq))
    open_now.set()
    assert eventually(lambda: rig.recorder.failed)
    assert rig.recorder.failed.startswith("only 0 MB free")
    assert [metadata(path)["ended"] for path in recordings(tmp_path)] == ["rotated", "rotated", "low space"]
    assert free(tmp_path) > 20_000
    rig.recorder.stop(5)


def test_where_the_disk_was_unmounted_nothing_is_written_to_the_empty_folder_until_it_is_back(tmp_path, monkeypatch):
    mount, mounted = tmp_path / "disk", [True]
    monkeypatch.setattr(os.path, "ismount", lambda path: path.name == "" or (path == mount and mounted[0]))
    rig = Rig(mount / "takes", flush_s=0.005)
    rig.recorder.start()
    rig.publish_image(depth(1))
    assert eventually(lambda: rig.written(1))
    mounted[0] = False
    mount.rename(tmp_path / "unmounted")
    rig.publish_image(depth(2))
    assert eventually(lambda: rig.said.message == f"RECORD_FAILED the disk at {mount} is not mounted any more")
    assert not mount.exists()
    (tmp_path / "unmounted").rename(mount)
    mounted[0] = True
    assert eventually(lambda: not rig.recorder.failed)
    rig.recorder.stop(5)
    for path in (mount / "takes").glob("*.active"):
        recover(path)
    assert sequences(mount / "takes") == [1, 2]


class Full(SlowFile):
    """A disk that is full after 5 kB."""

    def write(self, data):
        if self._file.tell() > 5000:
            raise OSError(28, "No space left on device")
        return self._file.write(data)


def test_a_disk_error_is_reported_at_once_and_the_file_can_be_recovered_while_recording_goes_on(tmp_path):
    rig = Rig(
        tmp_path, open_file=lambda path: SlowFile(path) if list(tmp_path.iterdir()) else Full(path), flush_s=0.005
    )
    rig.recorder.start()
    seq = 0
    while not rig.recorder.failed:
        rig.publish_image(depth(seq := seq + 1))
        threading.Event().wait(0.001)
    assert rig.recorder.failed == "[Errno 28] No space left on device"
    assert rig.said.message == "RECORD_FAILED [Errno 28] No space left on device"
    for _ in range(10):
        rig.publish_image(depth(seq := seq + 1))
    assert eventually(lambda: not rig.recorder.failed)
    rig.recorder.stop(5)
    assert rig.said.labels["last_failure"] == "[Errno 28] No space left on device"
    (left,) = tmp_path.glob("*.mcap.active")
    recover(left)
    saved = sequences(tmp_path)
    assert saved[-10:] == list(range(seq - 9, seq + 1)), "what waited in the queue"
    assert len(set(range(1, seq + 1)) - set(saved)) <= rig.said.counters["unsaved"]


def test_a_folder_that_cannot_be_written_is_said_leaves_no_scraps_and_is_tried_again(tmp_path):
    folder = tmp_path / "kept"
    folder.write_text("in the way of the folder")
    rig = Rig(folder, flush_s=0.005)
    rig.recorder.start()
    assert eventually(lambda: rig.recorder.failed)
    assert rig.said.message == f"RECORD_FAILED [Errno 20] {folder} is no folder"
    rig.publish_image(depth(1))
    folder.unlink()
    assert eventually(lambda: not rig.recorder.failed)
    rig.recorder.stop(5)
    assert [path.suffix for path in folder.iterdir()] == [".mcap"]
    assert sequences(folder) == [1]


def test_a_disk_that_takes_no_beginning_of_a_file_is_not_littered(tmp_path):
    class Refusing(SlowFile):
        def write(self, data):
            raise OSError(5, "Input/output error")

    rig = Rig(tmp_path, open_file=Refusing)
    rig.recorder.start()
    assert eventually(lambda: rig.recorder.failed)
    threading.Event().wait(3 * RETRY_S)
    rig.publish_image(depth(1))
    rig.recorder.stop(5)
    assert not list(tmp_path.iterdir())
    rig.recorder.report()
    assert rig.said.counters[f"dropped.{DEPTH}"] == 1


def test_what_the_disk_does_not_take_in_time_at_the_end_is_a_failure(tmp_path):
    files = []

    def slow(path):
        files.append(SlowFile(path))
        return files[-1]

    rig = Rig(tmp_path, open_file=slow, flush_s=0.005)
    rig.recorder.start()
    assert eventually(lambda: files)
    files[0].release.clear()
    rig.publish_image(depth(1))
    files[0].entered.get(timeout=5)
    rig.recorder.stop(0.01)
    files[0].release.set()
    assert rig.said.labels["last_failure"] == "the disk did not take within 0.01 s what waited"


def test_recordings_can_be_read_by_their_owner_and_group_only(tmp_path):
    rig = Rig(tmp_path)
    rig.recorder.start()
    rig.recorder.stop(5)
    (path,) = recordings(tmp_path)
    assert stat.filemode(path.stat().st_mode) == "-rw-r-----"
