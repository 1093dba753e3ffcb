"""The client at a live rig: a mesh that is made anew, processes that die, and a reader that is slow."""

import signal
import time

import numpy as np
import pytest
from abs_client import Rig, Status, subscribe

from evaluation.service.live.proc import children
from tests.system.running import START_S, kill, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.realtime]


def until(states, wanted, timeout_s=START_S):
    """States up to the first that is wanted; whatever comes, vertices and faces belong together."""
    given, end_s = [], time.monotonic() + timeout_s
    for state in states:
        given.append(state)
        assert len(state.vertices) == len(state.undeformed) == len(state.sigma)
        assert state.faces.max(initial=-1) < max(len(state.vertices), 1)
        if wanted(state):
            return given
        assert time.monotonic() < end_s, f"the last was {state.status}: {state.reasons}"
    raise AssertionError("the stream has ended")


def tracks(state):
    return state.status is Status.TRACKING


def test_a_mesh_that_is_made_anew_and_a_tracker_that_dies(run, endpoint):
    process, _ = run
    with Rig(endpoint) as rig, rig.states("sheet", maximum_age_s=0.5) as states:
        before = until(states, tracks)[-1]
        region = rig.reinitialize("sheet", seed=(88, 72))
        assert "pixel = [88, 72]" in region
        anew = until(states, lambda state: tracks(state) and state.mesh_version != before.mesh_version)[-1]
        assert anew.mesh_version > before.mesh_version

        kill(children(process.pid)["track"])
        silent = until(states, lambda state: state.status is Status.STALE, 10)[-1]
        assert not silent.usable
        assert silent.reasons[0].startswith("the newest estimate is ")
        again = until(states, tracks)[-1]
        assert again.message.header.boot_id != before.message.header.boot_id
        assert np.median(again.sigma) < 5e-3
        assert 0 < again.age_s < 0.5


def test_a_slow_reader_gets_the_newest(run, endpoint):
    _, listener = run
    with subscribe(endpoint) as states:
        until(states, tracks)
        numbers = []
        for _ in range(5):
            time.sleep(1.0)
            given = next(states)
            newest = listener.states()[-1][1].header.seq
            assert newest - given.seq <= 5
            numbers.append(given.seq)
        left_out = np.diff(numbers) - 1
        assert left_out.min() >= 1
        assert states.skipped >= left_out.sum()  # each estimate is given, or counted


def test_a_rig_that_is_started_again_is_found_again(rig_file, endpoint, launch):
    first = launch("run", rig_file, "--no-record", "--json", stdout=-3)
    wait_until(lambda: _connects(endpoint), START_S, "the first rig")
    with subscribe(endpoint, maximum_age_s=0.5) as states:
        until(states, tracks)
        first.send_signal(signal.SIGTERM)
        assert first.wait(10) == 0
        until(states, lambda state: state.status is Status.STALE, 10)
        launch("run", rig_file, "--no-record", "--json", stdout=-3)
        until(states, tracks)


def _connects(endpoint):
    try:
        subscribe(endpoint).close()
    except ConnectionError:
        return False
    return True
