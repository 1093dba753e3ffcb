"""Processes that are told to end: all at the end of a run, one of them to start again with another configuration."""

import pytest

from abs_service.supervision.children.child import ChildState
from abs_service.supervision.exit_codes import Exit
from tests.abs_service.supervision.fake_processes import S, World, ends, passes


@pytest.fixture
def world():
    return World()


def test_the_recorder_is_stopped_last(world):
    supervisor = world.supervisor("capture", "track/a", "record")
    supervisor.stop(world.wait)
    assert world.events == [("terminate", "capture"), ("terminate", "track/a"), ("terminate", "record")]
    assert {child.state for child in supervisor.children.values()} == {ChildState.STOPPED}
    assert world.now_ns == 0


def test_processes_that_do_not_end_in_time_are_killed_and_the_recorder_has_the_most_time(world):
    supervisor = world.supervisor("capture", "track/a", "record", stop_ns=4 * S)
    world.stubborn = {"capture", "track/a", "record"}
    times = {}
    supervisor.stop(lambda seconds: (world.wait(seconds), times.setdefault(len(world.events), world.now_ns)))
    assert [event for event in world.events if event[0] == "kill"] == [
        ("kill", "capture"),
        ("kill", "track/a"),
        ("kill", "record"),
    ]
    assert 4 * S <= world.now_ns < 4.1 * S
    assert supervisor.children["record"].reason == "did not end in time and was killed"


def test_a_renewed_process_ends_in_order_and_starts_again_which_counts_as_no_failure(world):
    supervisor = world.supervisor("capture", "track/a", restarts=0)
    for _ in range(3):
        supervisor.renew("track/a")
        assert supervisor.exit_code() is None
        supervisor.poll()
    track = supervisor.children["track/a"]
    assert (track.state, track.restarts, track.reason) == (ChildState.RUNNING, 0, "")
    assert world.events == 3 * [("terminate", "track/a")]
    assert [process.component for process in world.started] == ["capture", *4 * ["track/a"]]


def test_a_process_that_is_not_wanted_any_more_ends_in_order_or_is_killed(world):
    supervisor = world.supervisor("capture", "track/a", "track/b", "record", stop_ns=4 * S)
    world.stubborn = {"track/b"}
    supervisor.exchange([child for child in supervisor.children.values() if "track" not in child.component])
    assert sorted(world.events) == [("terminate", "track/a"), ("terminate", "track/b")]
    passes(world, supervisor, 3)
    assert (len(world.events), len(supervisor.processes())) == (2, 3)
    passes(world, supervisor, 1)
    assert (world.events[-1], len(supervisor.processes())) == (("kill", "track/b"), 2)
    assert (len(world.started), supervisor.exit_code()) == (4, None)


def test_a_renewed_process_that_does_not_end_is_killed_and_one_that_was_given_up_begins_again(world):
    supervisor = world.supervisor("capture", "record", stop_ns=4 * S)
    ends(world, supervisor, "record", 2)
    assert supervisor.exit_code() == Exit.USER
    supervisor.renew("record")
    supervisor.poll()
    assert (supervisor.children["record"].state, supervisor.exit_code()) == (ChildState.RUNNING, None)
    world.stubborn = {"record"}
    supervisor.renew("record")
    passes(world, supervisor, 3)
    assert supervisor.children["record"].state == ChildState.RENEWED
    passes(world, supervisor, 1)
    assert world.events[-1] == ("kill", "record")
    assert supervisor.children["record"].state == ChildState.RUNNING


def test_a_rig_that_is_stopped_does_not_start_what_was_to_be_renewed(world):
    supervisor = world.supervisor("capture")
    supervisor.renew("capture")
    supervisor.stop(world.wait)
    assert (supervisor.children["capture"].state, len(world.started)) == (ChildState.STOPPED, 1)


def test_a_process_that_finalises_its_file_is_not_told_twice_to_end(world):
    supervisor = world.supervisor("capture", "record")
    world.stubborn = {"record"}
    supervisor.renew("record")
    passes(world, supervisor, 1)
    supervisor.renew("record")
    passes(world, supervisor, 1)
    assert world.started[1].code is None, "by a second reload"
    supervisor.stop(world.wait)
    assert world.events.count(("terminate", "record")) == 1, "nor by the end of the run"


def test_a_second_reload_gives_a_process_no_more_time(world):
    supervisor = world.supervisor("record", stop_ns=4 * S)
    world.stubborn = {"record"}
    for _ in range(4):
        supervisor.renew("record")
        passes(world, supervisor, 1)
    assert world.events[-1] == ("kill", "record")
    assert supervisor.children["record"].state is ChildState.RUNNING


def renews(world, supervisor, component, code):
    """The process is renewed and ends with this code; None: not in time."""
    world.stubborn = {component}
    supervisor.renew(component)
    world.latest(component).code = code
    passes(world, supervisor, 5)
    world.stubborn = set()
    assert supervisor.children[component].state is ChildState.RUNNING


@pytest.mark.parametrize(("code", "worst"), [(0, 0), (1, 1), (143, 143), (-11, 139), (None, 137)])
def test_what_a_renewed_process_says_by_its_exit_code_is_kept_to_the_end(world, code, worst):
    supervisor = world.supervisor("record")
    renews(world, supervisor, "record", code)
    renews(world, supervisor, "record", 0)
    supervisor.stop(world.wait)
    record = supervisor.children["record"]
    assert (record.exit_code, record.worst_code) == (0, worst)


def test_a_process_that_is_told_to_end_before_it_has_begun_has_not_failed(world):
    supervisor = world.supervisor("record")
    renews(world, supervisor, "record", -15)
    assert supervisor.children["record"].worst_code == 0


@pytest.mark.parametrize(("code", "worst"), [(1, 1), (-9, 0)])
def test_what_a_process_says_by_its_exit_code_is_kept_over_restarts_and_a_crash_is_one_of_them(world, code, worst):
    supervisor = world.supervisor("record")
    ends(world, supervisor, "record", code)
    supervisor.stop(world.wait)
    record = supervisor.children["record"]
    assert (record.restarts, record.worst_code) == (1, worst)


def test_a_process_that_has_to_be_killed_at_the_end_has_failed(world):
    supervisor = world.supervisor("record")
    world.stubborn = {"record"}
    supervisor.stop(world.wait)
    assert supervisor.children["record"].worst_code == 137


def test_stopping_twice_or_without_children_is_harmless(world):
    supervisor = world.supervisor("capture")
    supervisor.stop(world.wait)
    supervisor.stop(world.wait)
    assert world.events == [("terminate", "capture")]
