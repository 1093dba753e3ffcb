import errno

import pytest

from abs_service.supervision.children.child import ChildState
from abs_service.supervision.children.child_process import ThreadTimes
from abs_service.supervision.exit_codes import Exit
from tests.abs_service.supervision.fake_processes import S, World, ends, passes


@pytest.fixture
def world():
    return World()


def test_all_children_are_started_at_once(world):
    supervisor = world.supervisor("capture", "track/sheet", "record")
    assert [process.component for process in world.started] == ["capture", "track/sheet", "record"]
    assert all(child.state is ChildState.RUNNING for child in supervisor.children.values())


def test_a_crashed_child_is_started_again_after_a_pause_that_doubles(world):
    supervisor = world.supervisor("capture")
    for pause_ns in (S // 5, 2 * S // 5, 4 * S // 5):
        world.latest("capture").code = -11
        supervisor.poll()
        started = len(world.started)
        world.now_ns += pause_ns - 1
        supervisor.poll()
        assert len(world.started) == started
        world.now_ns += 1
        supervisor.poll()
        assert len(world.started) == started + 1
    assert supervisor.children["capture"].restarts == 3


def test_a_child_that_had_worked_is_started_again_at_the_next_look_and_says_why_until_then(world):
    supervisor = world.supervisor("record")
    for _ in range(4):
        passes(world, supervisor, 11)
        world.latest("record").code = -9
        supervisor.poll()
        started, child = len(world.started), supervisor.children["record"]
        assert (child.state, "ended by signal 9" in child.reason) == (ChildState.BACKOFF, True)
        world.now_ns += S // 20
        supervisor.poll()
        assert len(world.started) == started + 1
    ends(world, supervisor, "record", -9)
    assert supervisor.children["record"].backoff_ns == S // 5, "which had not worked"


def test_a_child_that_crashes_too_often_is_given_up_and_the_others_go_on(world):
    supervisor = world.supervisor("capture", "track/a", "track/b")
    for _ in range(6):
        ends(world, supervisor, "track/a", 1)
    failed = supervisor.children["track/a"]
    assert (failed.state, failed.restarts) == (ChildState.FAILED, 5)
    assert "more than 5 restarts in 60 s" in failed.reason
    assert supervisor.exit_code() is None
    assert supervisor.children["track/b"].state is ChildState.RUNNING


def test_a_child_that_was_given_up_is_tried_again_when_the_window_is_over(world):
    supervisor = world.supervisor("capture", "record")
    for _ in range(6):
        ends(world, supervisor, "record", -9)
    record = supervisor.children["record"]
    assert record.state is ChildState.FAILED
    passes(world, supervisor, 55)
    assert record.state is ChildState.FAILED
    passes(world, supervisor, 2)
    assert (record.state, record.restarts, record.reason) == (ChildState.RUNNING, 6, "")
    ends(world, supervisor, "record", -9)
    assert (record.state, record.restarts) == (ChildState.RUNNING, 7), "with as many tries as before"


@pytest.mark.parametrize("component", ["capture", "track/a", "record"])
def test_a_file_that_is_wrong_when_a_child_starts_again_ends_nothing_and_is_tried_until_it_is_right(world, component):
    supervisor = world.supervisor("capture", "track/a", "record")
    world.words = "abs-service: error: sensors.tof.noise.file: No such file"
    ends(world, supervisor, component, -9)
    child = supervisor.children[component]
    for _ in range(20):
        ends(world, supervisor, component, Exit.USER)
        assert (child.state, child.lacks, supervisor.exit_code()) == (ChildState.RUNNING, True, None)
        assert "ended with code 2: abs-service: error: sensors.tof.noise.file: No such file" in child.reason
    assert (supervisor.misconfigured(), child.restarts) == (None, 21)
    supervisor.heartbeat(component, busy=True)
    assert (child.lacks, child.reason) == (False, ""), "it works"


def test_crashes_that_are_long_ago_are_forgiven(world):
    supervisor = world.supervisor("capture")
    for _ in range(20):
        world.now_ns += 15 * S
        ends(world, supervisor, "capture", 1)
    assert supervisor.children["capture"].state is ChildState.RUNNING


@pytest.mark.parametrize("lost", [["capture"], ["track/a", "track/b"]])
def test_without_images_or_any_tracker_there_is_nothing_left_to_do(world, lost):
    supervisor = world.supervisor("capture", "track/a", "track/b", "record", restarts=0)
    for component in lost:
        assert supervisor.exit_code() is None
        ends(world, supervisor, component, 1)
    assert supervisor.exit_code() is Exit.FAILED


def test_a_failed_recorder_stops_nothing(world):
    supervisor = world.supervisor("capture", "track/a", "record", restarts=0)
    ends(world, supervisor, "record", 1)
    assert supervisor.children["record"].state is ChildState.FAILED
    assert supervisor.exit_code() is None


def test_exit_code_2_of_anyone_stops_everything_and_keeps_the_message(world):
    supervisor = world.supervisor("capture", "track/a", "record")
    world.words = "abs-service: error: record.directory is read-only"
    ends(world, supervisor, "record", Exit.USER)
    refused = supervisor.misconfigured()
    assert refused is not None
    assert (refused.state, refused.restarts, refused.reason) == (ChildState.FAILED, 0, world.words)
    assert supervisor.exit_code() is Exit.USER


def test_a_child_that_cannot_connect_at_first_since_this_process_stood_still_is_started_again(world):
    supervisor = world.supervisor("capture", "track/a", "record")
    for component in ("capture", "track/a", "record"):
        ends(world, supervisor, component, Exit.NOTHING)
    assert (supervisor.misconfigured(), supervisor.exit_code()) == (None, None)
    assert all(child.state is ChildState.RUNNING for child in supervisor.children.values())


def test_when_the_devices_have_no_more_images_the_run_is_over(world):
    supervisor = world.supervisor("capture", "track/a")
    ends(world, supervisor, "capture", Exit.ENDED)
    assert supervisor.exit_code() is Exit.OK
    assert supervisor.children["capture"].restarts == 0


@pytest.mark.parametrize("component", ["capture", "track/a", "record"])
def test_a_process_that_ends_in_order_though_nobody_here_told_it_is_started_again(world, component):
    supervisor = world.supervisor("capture", "track/a", "record")
    ends(world, supervisor, component, Exit.OK)
    child = supervisor.children[component]
    assert (child.state, child.restarts, supervisor.exit_code()) == (ChildState.RUNNING, 1, None)


def test_a_silent_child_is_killed_and_started_again(world):
    supervisor = world.supervisor("capture")
    supervisor.heartbeat("capture")
    passes(world, supervisor, 9)
    supervisor.heartbeat("capture")
    passes(world, supervisor, 9)
    assert supervisor.children["capture"].state is ChildState.RUNNING
    passes(world, supervisor, 1)
    assert ("kill", "capture") in world.events
    assert supervisor.children["capture"].state is ChildState.STALLED
    passes(world, supervisor, 1)
    assert supervisor.children["capture"].state is ChildState.RUNNING
    assert supervisor.children["capture"].restarts == 1


def test_silence_is_said_within_two_seconds_long_before_the_child_is_killed(world):
    supervisor = world.supervisor("record")
    child = supervisor.children["record"]
    supervisor.heartbeat("record")
    passes(world, supervisor, 1)
    assert child.reason == ""
    passes(world, supervisor, 1)
    assert (child.state, child.reason) == (ChildState.RUNNING, "no health for 2 s")
    supervisor.heartbeat("record")
    assert child.reason == ""


def test_a_child_that_was_not_heard_because_the_supervisor_stood_still_is_not_killed(world):
    supervisor = world.supervisor("capture")
    supervisor.heartbeat("capture")
    passes(world, supervisor, 3)
    world.now_ns += 15 * S  # SIGSTOP, say
    passes(world, supervisor, 6)
    assert world.events == []
    passes(world, supervisor, 2)
    assert ("kill", "capture") in world.events, "but it has to say something afterwards"


def test_a_child_that_waits_for_a_processor_is_not_killed_until_it_hangs(world):
    supervisor = world.supervisor("track/a")
    supervisor.heartbeat("track/a")
    child, process = supervisor.children["track/a"], world.latest("track/a")
    for waited_s in range(60):
        process.its_threads = {1: ThreadTimes(S // 100, waited_s * S), 2: ThreadTimes(7, 7)}
        passes(world, supervisor, 1)
    assert world.events == []
    assert child.reason == "no health for 60 s, because it waits for a processor"
    supervisor.heartbeat("track/a")
    assert child.reason == ""
    passes(world, supervisor, 10)
    assert ("kill", "track/a") in world.events


@pytest.mark.parametrize(("ran_share", "killed"), [(0.0, False), (1.0, True)])
def test_a_child_that_would_run_is_starved_if_it_did_not_run_and_hangs_if_it_did(world, ran_share, killed):
    supervisor = world.supervisor("track/a")
    supervisor.heartbeat("track/a")
    for second in range(20):
        world.latest("track/a").its_threads = {1: ThreadTimes(int(ran_share * second * S), 0, runnable=True)}
        passes(world, supervisor, 1)
    assert (("kill", "track/a") in world.events) is killed


def test_a_child_that_waits_for_ever_is_killed_in_the_end(world):
    supervisor = world.supervisor("track/a", startup_ns=20 * S)
    supervisor.heartbeat("track/a")
    for waited_s in range(31):
        world.latest("track/a").its_threads = {1: ThreadTimes(0, waited_s * S)}
        passes(world, supervisor, 1)
    assert ("kill", "track/a") in world.events


def test_a_child_for_which_the_host_lacks_something_is_started_when_it_can_be(world):
    supervisor = world.supervisor("capture")
    world.lack = OSError(errno.EAGAIN, "Resource temporarily unavailable")
    for _ in range(20):
        ends(world, supervisor, "capture", 1)
    capture = supervisor.children["capture"]
    assert (capture.state, capture.restarts) == (ChildState.BACKOFF, 1)
    assert "cannot be started: [Errno 11]" in capture.reason
    world.lack = None
    passes(world, supervisor, 4)
    assert capture.state is ChildState.RUNNING


def test_health_of_unknown_components_is_ignored(world):
    supervisor = world.supervisor("capture")
    supervisor.heartbeat("track/elsewhere")
    assert list(supervisor.children) == ["capture"]
    assert world.events == []
