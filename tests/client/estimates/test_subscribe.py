"""A subscriber of a real router gets the newest estimate, whole, or is told that there is none."""

import asyncio
import re
import subprocess
import sys
import threading
import time

import pytest
from abs_client import NothingReceivedError, RangeError, Status, UnknownNameError, UnreachableError, subscribe

from tests.client.publishing import PERIOD_S, Tracker, estimating
from tests.waiting import eventually

LIMIT_S = 20.0

ABANDONED = """
import sys
from abs_client import subscribe
states = subscribe(sys.argv[1], maximum_age_s=0.1)
print(next(states).status)
"""


def first(states, status):
    """The first state with a status."""
    end_s = time.monotonic() + LIMIT_S
    for state in states:
        if state.status is status:
            return state
        assert time.monotonic() < end_s
    raise AssertionError("the stream has ended")


def test_faces_belong_to_the_vertices_also_after_the_mesh_was_remade(endpoint, tracker):
    sizes = set()
    with subscribe(endpoint) as states, estimating(tracker):
        for state in states:
            if state.status is Status.TRACKING:
                assert len(state.vertices) == len(state.undeformed) == len(state.faces) + 2
                assert len(state.vertices) == state.mesh_version + 3
                sizes.add(len(state.vertices))
                tracker.remesh()
            if len(sizes) == 5:
                break
    assert len(sizes) == 5


def test_a_topology_from_before_the_subscription_is_asked_for(endpoint, tracker):
    with estimating(tracker), subscribe(endpoint) as states:
        assert len(first(states, Status.TRACKING).faces) == 2


def test_a_misspelt_rig_or_tracker_is_answered_with_those_that_live(endpoint, bus):
    bus.declare_liveliness("track/sheet")
    for rig, name, wrong in (("dmo", "sheet", "sheet of rig dmo"), ("demo", "shet", "shet of rig demo")):
        with subscribe(endpoint, rig, name) as states:
            stale = first(states, Status.STALE)
        assert stale.reasons == (f"nothing was received of tracker {wrong} yet; there are sheet of rig demo",)
    with subscribe(endpoint, tracker="sheet") as states:
        assert first(states, Status.STALE).reasons == ("nothing was received of tracker sheet of rig demo yet",)


def test_a_slow_reader_gets_the_newest_and_the_rest_is_counted(endpoint, tracker):
    with subscribe(endpoint) as states:
        with estimating(tracker):
            before, skipped = first(states, Status.TRACKING), states.skipped
            assert eventually(lambda: tracker.seq > before.seq + 30)
        last, read = next(states), 1
        while last.seq < tracker.seq - 1:  # the last ones may still be on their way
            last, read = next(states), read + 1
            assert last.usable
        assert read < 10
        assert states.skipped - skipped == last.seq - before.seq - read


def test_silence_is_told_again_and_again_and_ends_with_a_new_tracker(endpoint, bus, tracker):
    with subscribe(endpoint, maximum_age_s=0.3) as states:
        assert next(states).status is Status.STALE
        with estimating(tracker):
            last = first(states, Status.TRACKING)
        silent = [first(states, Status.STALE) for _ in range(3)]
        assert [state.usable for state in silent] == [False] * 3
        assert silent[0].seq >= last.seq
        assert 0.3 <= silent[0].age_s < silent[1].age_s < silent[2].age_s
        assert silent[0].reasons == (f"the newest estimate is {silent[0].age_s:.1f} s old",)
        again = Tracker(bus, "second")
        again.size = 10
        again.remesh()
        with estimating(again):
            assert len(first(states, Status.TRACKING).vertices) == 11


def test_estimates_that_are_too_old_are_not_given(endpoint, tracker):
    with subscribe(endpoint, maximum_age_s=0.3) as states, estimating(tracker, age_s=0.8):
        end_s = time.monotonic() + 1.5
        ages_s = []
        while time.monotonic() < end_s:
            state = next(states)
            assert state.status is Status.STALE
            ages_s.append(state.age_s)
        assert states.skipped > 20
        assert 0.7 < ages_s[-1] < 2.0


def test_the_same_for_a_task(endpoint, tracker):
    async def read():
        given = []
        with subscribe(endpoint, maximum_age_s=0.3) as states:
            async for state in states:
                given.append(state.status)
                if given[-3:] == [Status.TRACKING] * 3 or len(given) > 50:
                    return given
        return given

    with estimating(tracker):
        assert asyncio.run(asyncio.wait_for(read(), LIMIT_S))[-1] is Status.TRACKING


def test_a_closed_stream_ends_and_has_nothing_more(endpoint, tracker):
    states = subscribe(endpoint, maximum_age_s=LIMIT_S)
    threading.Timer(0.2, states.close).start()
    assert list(states) == []
    with pytest.raises(NothingReceivedError):
        states.next(0.1)


def test_the_next_one_is_waited_for_no_longer_than_asked(endpoint, bus):
    with subscribe(endpoint, maximum_age_s=LIMIT_S) as states, pytest.raises(NothingReceivedError, match=r"0\.2 s"):
        states.next(0.2)


def test_malformed_messages_do_not_end_the_stream(endpoint, bus, tracker):
    with subscribe(endpoint) as states:
        for _ in range(5):
            tracker.put_malformed()
            time.sleep(PERIOD_S)
        with estimating(tracker):
            assert first(states, Status.TRACKING).usable


def test_a_program_that_forgets_to_close_ends_all_the_same(endpoint, tracker):
    with estimating(tracker):
        done = subprocess.run(
            [sys.executable, "-c", ABANDONED, endpoint],
            env={"PYTHONPATH": ":".join(sys.path)},
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
            check=False,
        )
    assert (done.returncode, done.stdout, done.stderr) == (0, "TRACKING\n", "")


def test_nobody_there_is_told(endpoint):
    with pytest.raises(UnreachableError, match=f"nothing answers at {endpoint}"):
        subscribe(endpoint)


@pytest.mark.parametrize("host", ["nowhere.invalid", "no..where", 64 * "n"])
def test_a_name_without_an_address_is_said(host):
    with pytest.raises(UnreachableError, match=re.escape(f'the name "{host}" in tcp/{host}:7447 cannot be')):
        subscribe(f"tcp/{host}:7447")


@pytest.mark.parametrize("wrong", [{"endpoint": "127.0.0.1"}, {"rig": "a/b"}, {"tracker": "**"}])
def test_a_name_that_cannot_be_one_is_told(endpoint, wrong):
    with pytest.raises(UnknownNameError, match=r"no endpoint|no name"):
        subscribe(**{"endpoint": endpoint} | wrong)


@pytest.mark.parametrize("maximum_age_s", [0.0, -1.0, float("nan")])
def test_an_age_that_no_estimate_has_is_told(endpoint, maximum_age_s):
    with pytest.raises(RangeError, match=f"maximum_age_s is {maximum_age_s:g}: it must be greater than 0"):
        subscribe(endpoint, maximum_age_s=maximum_age_s)


def test_without_a_largest_age_silence_is_not_told(endpoint, tracker):
    with subscribe(endpoint, maximum_age_s=float("inf")) as states:
        with pytest.raises(NothingReceivedError, match=r"within 0\.2 s"):
            states.next(0.2)
        with estimating(tracker, age_s=3600.0):
            assert states.next(LIMIT_S).age_s > 3599.0
