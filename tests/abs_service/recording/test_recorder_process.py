"""The real recorder process under what kills recordings: SIGKILL, a full disk, SIGTERM at any moment."""

import random
import re
import resource
import signal
import time

import pytest
from absmsg.v1.health_pb2 import Health

from abs_service.recording.recovery import recover
from tests.abs_service.recording.live_stream import TOPIC, Stream, frames

# Each test starts at least one interpreter that imports everything.
pytestmark = pytest.mark.slow

FLUSH_S = 0.2


@pytest.fixture
def rig(tmp_path, endpoint):
    """A configuration whose recordings go to `tmp_path / "kept"`."""
    path = tmp_path / "rig.toml"
    path.write_text(
        f"""
version = 1
name = "demo"
bus.endpoint = "{endpoint}"
devices.sim.uri = "simulated://sheet?seed=1"
sensors.tof.device = "sim"
[record]
directory = "kept"
flush_s = {FLUSH_S}
minimum_free_bytes = 0
"""
    )
    return path


TRACKER = """
[sensors.tof.noise]
type = "constant"
sigma = 0.01
[trackers.sheet]
sensors = ["tof"]
reference = "tof/depth"
model.type = "rigid"
region.type = "nearest"
objective.type = "likelihood"
optimizer.type = "hybrid"
"""


def is_recording(health):
    return health.counters["recorded"] > 20


@pytest.mark.realtime
def test_a_killed_recorder_loses_a_second_at_most_and_the_next_one_recovers_the_rest(rig, endpoint, launch):
    chance = random.Random(7)
    killed_s = []
    with Stream(endpoint) as stream:
        for _ in range(3):
            recorder = launch("record", rig)
            stream.wait_for(is_recording)
            time.sleep(chance.uniform(0.0, 0.7))
            killed_s.append(time.time())
            stream.kill(recorder)
        recorder = launch("record", rig)
        stream.wait_for(lambda health: health.counters["recovered"] == 1)
        recorder.send_signal(signal.SIGTERM)
        assert recorder.wait(5) == 0
    recordings = sorted(rig.parent.glob("kept/*.mcap"))
    assert len(recordings) == 4
    assert not list(rig.parent.glob("kept/*.active"))
    for path, end_s in zip(recordings, killed_s):
        saved = frames(path)
        assert end_s - saved[-1][1] < FLUSH_S + 0.8
        assert [seq for seq, _ in saved] == list(range(saved[0][0], saved[-1][0] + 1)), "a hole"


def test_a_full_disk_is_reported_and_all_that_was_written_is_recovered(rig, endpoint, launch):
    limit = 300_000
    recorder = launch("record", rig, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
    with Stream(endpoint) as stream:
        health = stream.wait_for(lambda health: health.level == Health.LEVEL_ERROR)
        assert health.message == "RECORD_FAILED [Errno 27] File too large"
        stream.wait_for(lambda health: health.counters["failures"] > 1)  # it was tried again
        recorder.send_signal(signal.SIGTERM)
        assert recorder.wait(5) == 1
    assert "RECORD_FAILED [Errno 27] File too large" in recorder.stderr.read()
    left = sorted(rig.parent.glob("kept/*.active"))
    assert len(left) > 1
    assert all(path.stat().st_size <= limit for path in left)
    saved = frames(recover(left[0]).target)
    assert len(saved) > 20
    assert [seq for seq, _ in saved] == list(range(saved[0][0], saved[-1][0] + 1))


@pytest.mark.realtime
def test_a_folder_that_is_taken_away_and_comes_back_costs_no_frame(rig, endpoint, launch):
    kept, moved = rig.parent / "kept", rig.parent / "moved"
    recorder = launch("record", rig)
    with Stream(endpoint) as stream:
        stream.wait_for(is_recording)
        kept.rename(moved)
        kept.write_text("in the way of a new folder")
        at_s = time.monotonic()
        health = stream.wait_for(lambda health: health.level == Health.LEVEL_ERROR)
        print(f"noticed after {time.monotonic() - at_s:.2f} s")
        assert time.monotonic() - at_s < 2.0
        assert health.message.endswith(".mcap was moved while it was written")
        stream.wait_for(lambda health: f"{kept} is no folder" in health.message)
        kept.unlink()
        at_s = time.monotonic()
        stream.wait_for(lambda health: health.level == Health.LEVEL_OK)
        print(f"recording again after {time.monotonic() - at_s:.2f} s")
        recorder.send_signal(signal.SIGTERM)
        assert recorder.wait(5) == 1
    (before,), (after,) = moved.glob("*"), kept.glob("*")
    saved = [seq for path in (before, after) for seq, _ in frames(path)]
    assert saved == list(range(saved[0], saved[-1] + 1)), "it did not wait in the queue"


def test_the_queue_is_as_large_as_the_configuration_says(rig, endpoint, launch):
    rig.write_text(rig.read_text() + "queue_bytes = 1048576\n")
    recorder = launch("record", rig)
    with Stream(endpoint, shape=(480, 640)) as stream:
        stream.wait_for(is_recording)
        (rig.parent / "kept").rename(rig.parent / "moved")
        (rig.parent / "kept").write_text("in the way")
        health = stream.wait_for(lambda health: health.counters[f"dropped.{TOPIC}"] > 100)
        assert health.gauges["queue_bytes"] <= 1048576
        recorder.kill()


def test_the_oldest_recordings_are_deleted_as_the_configuration_says(rig, endpoint, launch):
    rig.write_text(rig.read_text() + "rotate_bytes = 100_000\nretain_bytes = 1_000_000\n")
    launch("record", rig)
    with Stream(endpoint) as stream:
        health = stream.wait_for(lambda health: health.counters["deleted"] > 0)
        assert not (rig.parent / "kept" / health.labels["deleted"]).exists()
        assert health.labels["forecast"].startswith("the last ")


def test_estimates_of_deleted_recordings_are_kept_as_the_configuration_says(rig, endpoint, launch):
    rig.write_text(rig.read_text() + "rotate_bytes = 100_000\nretain_bytes = 1_000_000\nestimates = true\n")
    recorder = launch("record", rig)
    with Stream(endpoint) as stream:
        health = stream.wait_for(lambda health: health.counters["deleted"] > 0)
        recorder.send_signal(signal.SIGTERM)
        assert recorder.wait(5) == 0
    names = {path.name.removesuffix(".mcap") for path in rig.parent.glob("kept/*.mcap")}
    assert health.labels["deleted"].removesuffix(".mcap") not in names
    assert health.labels["deleted"].removesuffix(".mcap") + "_estimates" in names
    assert {f"{name}_estimates" for name in names if not name.endswith("_estimates")} < names


@pytest.mark.realtime
def test_it_records_with_what_was_before_when_it_is_asked_and_goes_on_after_a_kill(rig, endpoint, launch):
    rig.write_text(rig.read_text() + 'when = "requested"\npre_roll_s = 0.5\n')
    with Stream(endpoint) as stream:
        recorder = launch("record", rig)
        stream.wait_for(lambda health: health.labels["trigger"] == "waits, and holds the last 1 s")
        assert not list(rig.parent.glob("kept/*"))
        asked_s = time.time()
        assert launch("trigger", rig).wait(20) == 0
        stream.wait_for(is_recording)
        stream.kill(recorder)
        recorder = launch("record", rig)
        stream.wait_for(lambda health: health.labels["trigger"] == "asked for" and is_recording(health))
        assert launch("trigger", rig, "--stop").wait(20) == 0
        health = stream.wait_for(
            lambda health: health.labels["trigger"].startswith("waits") and not health.labels["file"]
        )
        assert re.fullmatch(r"record off from process \w+ on \S+: accepted", health.labels["command"])
        recorder.send_signal(signal.SIGTERM)
        assert recorder.wait(5) == 0
    first, second = sorted(rig.parent.glob("kept/*.mcap"))
    for path in (first, second):
        saved = frames(path)
        assert [seq for seq, _ in saved] == list(range(saved[0][0], saved[-1][0] + 1))
    assert frames(first)[0][1] > asked_s - 0.6


@pytest.mark.realtime
def test_sigterm_while_frames_come_ends_with_a_complete_file(rig, endpoint, launch):
    recorder = launch("record", rig)
    with Stream(endpoint) as stream:
        stream.wait_for(is_recording)
        before_s = time.monotonic()
        recorder.send_signal(signal.SIGTERM)
        assert recorder.wait(5) == 0
        assert time.monotonic() - before_s < 3
    (path,) = rig.parent.glob("kept/*")
    assert path.suffix == ".mcap"
    saved = frames(path)
    assert [seq for seq, _ in saved] == list(range(saved[0][0], saved[-1][0] + 1))


@pytest.mark.realtime
def test_what_was_sent_to_a_recorder_that_stood_still_is_recorded_though_it_is_to_end(rig, endpoint, launch):
    """The last second of a rig was lost without a word, since its recorder ended as soon as it went on."""
    recorder = launch("record", rig)
    with Stream(endpoint) as stream:
        stream.wait_for(is_recording)
        stream.stop_between_frames(recorder)
        time.sleep(0.8)
        published = stream.end()
        recorder.send_signal(signal.SIGTERM)
        recorder.send_signal(signal.SIGCONT)
        assert recorder.wait(5) == 0
    (path,) = rig.parent.glob("kept/*")
    saved = frames(path)
    assert [seq for seq, _ in saved] == list(range(saved[0][0], published))


def test_a_rig_that_does_not_run_is_explained(rig, launch):
    recorder = launch("record", rig)
    assert recorder.wait(20) == 3
    assert "nothing answers there" in recorder.stderr.read()


def test_the_recorder_says_that_nothing_is_tracked_and_begins_with_it_if_told_to(rig, endpoint, launch):
    text = rig.read_text() + TRACKER
    for begin, remark in (("start", "nothing is tracked yet"), ("tracking", "begins when something is tracked")):
        rig.write_text(text.replace("[record]", f'[record]\nbegin = "{begin}"'))
        with Stream(endpoint) as stream:
            recorder = launch("record", rig)
            health = stream.wait_for(lambda health, said=remark: health.labels["tracking"] == said)
            assert bool(health.labels["file"]) == (begin == "start")
            stream.track()
            tracked_s = time.time()
            stream.wait_for(lambda health: is_recording(health) and not health.labels["tracking"])
            recorder.send_signal(signal.SIGTERM)
            assert recorder.wait(5) == 0
        path = max(rig.parent.glob("kept/*.mcap"))
        assert (frames(path)[0][1] < tracked_s) == (begin == "start")
