"""`kill -9` and SIGTERM on a running rig: the process is restarted, the others go on, and no recording is lost."""

import itertools
import os
import signal
import time
from collections.abc import Sequence

import pytest
from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.health_pb2 import Health
from mcap.reader import make_reader

from evaluation.service.live.proc import children, is_running
from tests.system.running import kill, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.realtime]

DEPTH = "tof/depth/image"


def lost(frames: Sequence[FrameInfo]) -> int:
    """Exposures whose images did not arrive; the device must not have begun anew."""
    assert len({info.epoch for info in frames}) == 1, "the device was opened again"
    numbers = [info.seq for info in frames]
    assert numbers == sorted(set(numbers)), "twice, or out of order"
    return numbers[-1] - numbers[0] + 1 - len(numbers)


def not_published(listener) -> int:
    """Exposures that capture itself says it left out."""
    counters = listener.health("capture")[-1].counters
    return counters["device.sim.late"] + counters[f"dropped.{DEPTH}"]


def test_a_killed_tracker_comes_back_and_capture_goes_on(run):
    process, listener = run
    boot_id = listener.states()[-1][1].header.boot_id
    killed_ns = kill(children(process.pid)["track"])
    wait_until(listener.tracks_since(killed_ns), 30, "TRACKING again")
    back_ns, state = next((t, s) for t, s in listener.states() if s.header.t_host_ns > killed_ns)
    print(f"estimates again {(back_ns - killed_ns) * 1e-9:.1f} s after kill -9 of the tracker")
    assert state.header.boot_id != boot_id
    wait_until(lambda: listener.health("run")[-1].counters["restarts.track/sheet"] == 1, 5, "the restart in health")
    frames = listener.frames(DEPTH)
    # On a busy machine the listener itself may miss one or two that were published.
    assert lost(frames) <= not_published(listener) + 0.05 * len(frames)


def newest_image_ns(path) -> int:
    with path.open("rb") as stream:
        last = next(make_reader(stream).iter_messages(topics=f"/{DEPTH}", reverse=True))
    return last[2].log_time


def test_a_killed_recorder_comes_back_and_its_file_is_saved_up_to_the_last_second(run, tmp_path):
    process, listener = run
    wait_until(lambda: any(h.gauges["file_bytes"] > 1e6 for h in listener.health("record")), 20, "a growing file")
    # The file was flushed just now; most of a second later there is most to lose.
    late = len(listener.frames(DEPTH)) + 22
    wait_until(lambda: len(listener.frames(DEPTH)) > late, 10, "more images")
    kill(children(process.pid)["record"])
    killed_s = time.time()
    (cut,) = (tmp_path / "takes").glob("*.mcap.active")
    saved = cut.with_name(cut.name.removesuffix(".active"))
    wait_until(saved.exists, 30, "recovery")
    lost_s = killed_s - newest_image_ns(saved) * 1e-9
    print(f"kill -9 of the recorder lost {lost_s:.2f} s")
    assert lost_s < 1.3  # what is not flushed within a second, and what was on its way
    (active,) = wait_until(lambda: list((tmp_path / "takes").glob("*.mcap.active")), 10, "a new file")
    assert active != cut
    size = active.stat().st_size
    wait_until(lambda: active.stat().st_size > size + 1_000_000, 10, "growth of the new file")
    frames = listener.frames(DEPTH)
    # On a busy machine the listener itself may miss one or two that were published.
    assert lost(frames) <= not_published(listener) + 0.05 * len(frames)
    assert len({state.header.boot_id for _, state in listener.states()}) == 1, "the tracker was not restarted"


def image_times_s(folder):
    """Times of all images of the finished recordings of a folder [s]."""
    found = []
    for path in folder.glob("*.mcap"):
        with path.open("rb") as stream:
            found += [message.log_time * 1e-9 for *_, message in make_reader(stream).iter_messages(topics=f"/{DEPTH}")]
    return sorted(found)


def test_a_killed_recorder_leaves_a_gap_of_a_second_and_a_half_at_most(run, tmp_path):
    process, listener = run
    killed = wait_until(lambda: listener.health("record"), 10, "health")[-1].header.boot_id
    kill(children(process.pid)["record"])
    wait_until(lambda: listener.health("record")[-1].header.boot_id != killed, 10, "health of the next one")
    wait_until(lambda: listener.health("record")[-1].counters["recovered"] == 1, 30, "recovery")
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) == 0
    times = image_times_s(tmp_path / "takes")
    gap_s = max(b - a for a, b in itertools.pairwise(times))
    print(f"kill -9 of the recorder left a gap of {gap_s:.2f} s")
    assert gap_s < 1.5


def replaced(run, command):
    """Tells a process of `run` to end; returns the moment when there is another one [ns]."""
    process_id = children(run)[command]
    os.kill(process_id, signal.SIGTERM)
    wait_until(lambda: children(run).get(command, process_id) != process_id, 10, f"another {command}")
    return time.monotonic_ns()


def test_processes_that_somebody_tells_to_end_are_started_again(run, tmp_path):
    process, listener = run
    for command in ("capture", "track", "record"):
        wait_until(listener.tracks_since(replaced(process.pid, command)), 30, "TRACKING again")
    takes = [path for path in (tmp_path / "takes").iterdir() if path.suffix == ".mcap"]
    assert len(takes) == 1, "the file of the first recorder is complete"
    counters = listener.health("run")[-1].counters
    assert [counters[f"restarts.{one}"] for one in ("capture", "track/sheet", "record")] == [1, 1, 1]
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) == 0


def test_a_folder_that_cannot_be_written_ends_neither_tracking_nor_recording_for_good(run, tmp_path):
    process, listener = run
    (tmp_path / "takes").rename(tmp_path / "moved")
    (tmp_path / "takes").write_text("in the way")
    kill(children(process.pid)["record"])
    killed_ns = time.monotonic_ns()

    def says(level, text):
        return lambda: any(last.level == level and text in last.message for last in listener.health("record")[-1:])

    failed = f"RECORD_FAILED [Errno 20] {tmp_path / 'takes'} is no folder"
    wait_until(says(Health.LEVEL_ERROR, failed), 30, "the failure in health")
    wait_until(listener.tracks_since(killed_ns, 30), 10, "estimates meanwhile")
    (tmp_path / "takes").unlink()
    wait_until(says(Health.LEVEL_OK, ""), 5, "recording again")
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) == 1, "the recording has a gap"
    assert [path.suffix for path in (tmp_path / "takes").iterdir()] == [".mcap"]


def test_nothing_survives_a_killed_run(run):
    process, _ = run
    alive = children(process.pid)
    assert alive.keys() == {"fork-server", "capture", "track", "record"}
    begin_ns = kill(process.pid)
    wait_until(lambda: not any(map(is_running, alive.values())), 5, "the end of the children")
    print(f"the children ended {(time.monotonic_ns() - begin_ns) * 1e-9:.1f} s after kill -9 of run")
