"""The recorder with a disk that fails again and again."""

import threading
import time

import pytest

from abs_service.recording.disk import folder, stall
from abs_service.recording.disk.backoff import Backoff
from tests.abs_service.recording import recorder_rig
from tests.abs_service.recording.recorder_rig import RETRY_S, Rig, depth
from tests.waiting import eventually


class Failing:
    """A file of a disk that takes 5 kB."""

    healed = False

    def __init__(self, path):
        self._file = path.open("xb")

    def write(self, data):
        if self._file.tell() > 5000 and not self.healed:
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


@pytest.mark.slow
@pytest.mark.realtime
def test_meanwhile_nobody_says_that_it_does_not_answer_and_a_healed_one_is_used_at_once(tmp_path, monkeypatch):
    monkeypatch.setattr(Failing, "healed", False)
    monkeypatch.setattr(folder, "takes", lambda _: Failing.healed)
    monkeypatch.setattr(recorder_rig, "RETRY_S", 0.2)
    monkeypatch.setattr(stall, "ERROR_NS", stall.SAID_NS)  # as after 10 s of a longer pause
    rig = Rig(tmp_path, open_file=Failing, chunk_bytes=1000)
    rig.recorder.start()
    stop = threading.Event()

    def publish():
        while not stop.wait(0.01):
            rig.publish_image(depth(time.monotonic_ns() % 1000))

    thread = threading.Thread(target=publish)
    thread.start()
    assert eventually(lambda: len(list(tmp_path.iterdir())) == 4, 20)
    for _ in range(25):  # of the 3.2 s of the fourth pause
        time.sleep(0.1)
        rig.recorder.stall.report()
        assert "has not answered" not in rig.said.message
    assert eventually(lambda: len(list(tmp_path.iterdir())) == 5, 20)
    time.sleep(0.5)
    Failing.healed, healed_s = True, time.monotonic()
    assert eventually(lambda: not rig.recorder.failed, 10)
    took_s = time.monotonic() - healed_s
    stop.set()
    thread.join()
    rig.recorder.stop(5)
    assert took_s < 3, "of the 6.4 s of the fifth pause"


@pytest.mark.parametrize(
    ("takes", "pauses"),
    [([False] * 40, 32), ([True] * 40, 32), ([True, False, False, True], 4)],
    ids=["never", "always, but no recording", "again"],
)
def test_a_pause_ends_when_the_disk_takes_what_it_refused(tmp_path, monkeypatch, takes, pauses):
    answers, waited, alive = iter(takes), [], []
    monkeypatch.setattr(folder, "takes", lambda _: next(answers))
    backoff = Backoff(tmp_path, 1.0, lambda seconds: bool(waited.append(seconds)), lambda: alive.append(1))
    backoff.left = 7
    backoff.pause()
    assert (waited, len(alive)) == ([1.0] * pauses, pauses)


def test_a_disk_takes_a_file_or_not(tmp_path):
    assert folder.takes(tmp_path)
    assert not folder.takes(tmp_path / "none")
    assert not list(tmp_path.iterdir())
