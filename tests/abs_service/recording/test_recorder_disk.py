"""The recorder with a disk that is slow, nearly full, full or missing."""

import queue
import threading

from tests.abs_service.recording.recorder_rig import DEPTH, Rig, depth, metadata, read, recordings
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


def test_it_stops_before_the_disk_is_full_with_a_complete_file(tmp_path):
    free = iter([10**9, 10**9, 999])
    rig = Rig(tmp_path, free_bytes=lambda folder: next(free, 999), minimum_free_bytes=1000, flush_s=0.005)
    rig.recorder.start()
    rig.publish_image(depth(1))
    assert eventually(lambda: rig.recorder.failed)
    rig.recorder.stop(5)
    assert rig.recorder.failed.startswith("only 0 MB free in")
    assert rig.said.message.startswith("RECORD_FAILED only 0 MB free")
    (path,) = recordings(tmp_path)
    assert metadata(path)["ended"] == "low space"


def test_a_disk_error_is_reported_at_once_and_the_file_can_be_recovered(tmp_path):
    class Full(SlowFile):
        def write(self, data):
            if self._file.tell() > 5000:
                raise OSError(28, "No space left on device")
            return self._file.write(data)

    rig = Rig(tmp_path, open_file=Full, flush_s=0.005)
    rig.recorder.start()
    seq = 0
    while not rig.recorder.failed:
        rig.publish_image(depth(seq := seq + 1))
        threading.Event().wait(0.001)
    assert rig.recorder.failed == "[Errno 28] No space left on device"
    rig.publish_image(depth(0))  # harmless
    rig.recorder.stop(5)
    assert rig.said.message == "RECORD_FAILED [Errno 28] No space left on device"
    assert recordings(tmp_path) == []
    assert len(list(tmp_path.glob("*.mcap.active"))) == 1


def test_a_folder_that_is_gone_is_an_error_like_any_other(tmp_path):
    rig = Rig(tmp_path / "nowhere")
    rig.recorder.start()
    assert eventually(lambda: rig.recorder.failed)
    rig.recorder.stop(5)
    assert "No such file or directory" in rig.recorder.failed
