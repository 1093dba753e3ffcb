"""Processes that stand still for a while, or get hardly any processor: none is killed, and losses are counted."""

import os
import signal
import subprocess
import sys
import time

import pytest

from evaluation.service.live.proc import children
from tests.system.running import wait_until, write_rig

pytestmark = [pytest.mark.slow, pytest.mark.realtime]

#: Shorter than by default, to be quick.
STALL_S = 3.0
BUSY = "import os\nos.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\nwhile True: pass"


@pytest.fixture
def rig_file(tmp_path, endpoint):
    path = write_rig(tmp_path / "rig.toml", endpoint)
    text = path.read_text()
    assert "stall_timeout_s = 10.0" in text
    path.write_text(text.replace("stall_timeout_s = 10.0", f"stall_timeout_s = {STALL_S}"))
    return path


def restarts(listener):
    counters = listener.health("run")[-1].counters
    return {name: number for name, number in counters.items() if name.startswith("restarts.")}


def stop_for(pid, seconds):
    os.kill(pid, signal.SIGSTOP)
    time.sleep(seconds)
    os.kill(pid, signal.SIGCONT)
    return time.monotonic_ns()


def test_a_supervisor_that_stood_still_kills_nobody(run):
    process, listener = run
    alive = children(process.pid)
    continued_ns = stop_for(process.pid, 3 * STALL_S)
    wait_until(listener.tracks_since(continued_ns), 20, "TRACKING after the stop")
    wait_until(lambda: _later(listener.health("run"), continued_ns + 2e9), 10, "health of run")
    assert children(process.pid) == alive
    assert set(restarts(listener).values()) == {0}


def test_frames_that_a_stopped_tracker_missed_are_all_counted(run):
    process, listener = run
    tracker = children(process.pid)["track"]
    continued_ns = stop_for(tracker, STALL_S - 1)
    wait_until(listener.tracks_since(continued_ns + 10**9), 20, "TRACKING after the stop")
    state = listener.states()[-1][1]
    health = wait_until(lambda: _later(listener.health("track/sheet"), state.header.t_host_ns), 5, "health")
    causes = {
        name: n for name, n in health.counters.items() if name.endswith("tof/depth/image") or "tof/depth." in name
    }
    lost = sum(causes.values()) + health.counters["skipped"]
    published = {info.seq for info in listener.frames("tof/depth/image")}
    tracked = {s.seq for _, one in listener.states() for s in one.sensors if s.sensor == "tof" and not s.missing}
    missed = {seq for seq in published if min(tracked) < seq < max(tracked)} - tracked
    print(f"{len(missed)} frames missed, counted: {causes}, {health.counters['skipped']} skipped")
    assert len(missed) > 10
    assert abs(lost - len(missed)) <= 5  # what was on its way when health was sent, and before the listener came


def _later(healths, t_ns):
    return next((health for health in healths if health.header.t_host_ns > t_ns), None)


def test_a_starved_tracker_is_not_restarted(run):
    process, listener = run
    tracker = children(process.pid)["track"]
    first = min(os.sched_getaffinity(0))
    busy = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(2)]
    try:
        for thread in map(int, os.listdir(f"/proc/{tracker}/task")):
            os.sched_setaffinity(thread, {first})
            os.sched_setscheduler(thread, os.SCHED_IDLE, os.sched_param(0))
        time.sleep(4 * STALL_S)
        messages = [health.message for health in listener.health("run")]
    finally:
        for one in busy:
            one.kill()
            one.wait()
    now_ns = time.monotonic_ns()
    wait_until(listener.tracks_since(now_ns), 60, "TRACKING again")
    assert children(process.pid)["track"] == tracker
    assert set(restarts(listener).values()) == {0}
    assert any("waits for a processor" in message or "no estimate" in message for message in messages)
