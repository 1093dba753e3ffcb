"""The recorder with a disk that fails again and again."""

import threading
import time

from tests.abs_service.recording.recorder_rig import RETRY_S, Rig, depth


class Failing:
    """A file of a disk that takes 5 kB."""

    def __init__(self, path):
        self._file = path.open("xb")

    def write(self, data):
        if self._file.tell() > 5000:
            raise OSError(5, "Input/output error")
        return self._file.write(data)

    def __getattr__(self, name):
        return getattr(self._file, name)


def test_a_disk_that_takes_the_beginning_of_every_file_is_tried_ever_more_rarely(tmp_path):
    rig = Rig(tmp_path, open_file=Failing, chunk_bytes=1000)
    rig.recorder.start()
    end = time.monotonic() + 60 * RETRY_S
    while time.monotonic() < end:
        rig.publish_image(depth(time.monotonic_ns() % 1000))
        threading.Event().wait(0.001)
    rig.recorder.stop(5)
    assert 1 < len(list(tmp_path.iterdir())) <= 6, "after 2, 4, 8, 16 and 32 times as long"
