"""A disk that does not answer is in the recorder's health before anything is lost."""

import time

from absmsg.v1.health_pb2 import Health

from tests.abs_service.recording.disk.test_recorder_disk import SlowFile
from tests.abs_service.recording.recorder_rig import Rig, depth, sequences
from tests.waiting import eventually

S = 1_000_000_000


def test_it_is_said_within_two_seconds_and_nothing_is_lost(tmp_path):
    files, ahead_ns = [], [0]

    def slow(path):
        files.append(SlowFile(path))
        return files[-1]

    rig = Rig(tmp_path, open_file=slow, flush_s=0.01, monotonic=lambda: time.monotonic_ns() + ahead_ns[0])

    def said(after_s):
        ahead_ns[0] = after_s * S
        rig.recorder.stall.report()
        return rig.said

    rig.recorder.stall.report()
    assert rig.said.level == Health.LEVEL_OK, "it has not begun"
    rig.recorder.start()
    assert eventually(lambda: files)
    files[0].release.clear()
    rig.publish_image(depth(1))
    files[0].entered.get(timeout=5)
    rig.publish_image(depth(2))
    assert said(after_s=0).level == Health.LEVEL_OK
    late = said(after_s=2)
    assert (late.level, late.message) == (
        Health.LEVEL_WARNING,
        "the disk has not answered for 2 s; 0 MB wait in memory",
    )
    assert said(after_s=11).level == Health.LEVEL_ERROR
    files[0].release.set()
    assert eventually(lambda: said(after_s=11).level == Health.LEVEL_OK)
    rig.recorder.stop(5)
    assert sequences(tmp_path) == [1, 2]
