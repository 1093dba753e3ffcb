"""The exit code of `run` says whether its recordings are complete, and whether anything was tracked."""

import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.commands.running import outcome
from abs_service.supervision.children.child import Child, ChildState
from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.health.rig_state import RigState
from abs_service.supervision.health.rig_view import RigPlaces, RigView
from abs_service.tracking.log.tracker_log import TrackerLog


def view(code, *failures):
    """A rig whose recorder ended with this code, after processes of it that said so many failures each."""
    live = RigState([], lambda: 0)
    for boot, number in enumerate(failures):
        said = Health(component="record", header=Header(boot_id=str(boot)), counters={"failures": number})
        live.take(Sample(keys.health("record"), Health.DESCRIPTOR.full_name, said.SerializeToString()))
    ended = Child("record", (), 0, ChildState.STOPPED, worst_code=code)
    return RigView(RigPlaces("bench"), live, [ended], 0.0, 0, "")


@pytest.mark.parametrize(("code", "expected"), [(0, Exit.OK), (1, Exit.FAILED), (137, Exit.FAILED)])
def test_the_recorders_own_code_counts(code, expected):
    assert outcome.recording_code(view(code, 0)) is expected


def test_a_failure_counts_though_the_recorder_that_had_it_was_killed():
    assert outcome.recording_code(view(0, 1, 0)) is Exit.FAILED
    assert outcome.recording_code(view(0, 0, 0)) is Exit.OK


def log(*statuses):
    """A tracker that said these statuses."""
    made = TrackerLog()
    for status in (*statuses, DeformationState.STATUS_LOST):  # the last one still waits for its mesh
        list(made.take_state(DeformationState(status=status)))
    return made


def test_trackers_that_never_tracked_are_named():
    found, lost = log(DeformationState.STATUS_DEGRADED), log(DeformationState.STATUS_INITIALIZING)
    assert outcome.untracked({"hat": found, "sheet": lost, "scarf": TrackerLog()}) == ["sheet", "scarf"]
    assert "nothing was tracked" in lost.summary()
    assert "nothing was tracked" not in found.summary()


@pytest.mark.parametrize(
    ("recorder", "statuses", "stopped", "expected"),
    [
        (0, [DeformationState.STATUS_TRACKING], False, Exit.OK),
        (0, [DeformationState.STATUS_INITIALIZING], False, Exit.FAILED),
        (0, [DeformationState.STATUS_INITIALIZING], True, Exit.OK),  # by a user, who did not wait
        (1, [DeformationState.STATUS_TRACKING], False, Exit.FAILED),
        (1, [DeformationState.STATUS_TRACKING], True, Exit.FAILED),
    ],
)
def test_a_run_fails_if_it_ended_by_itself_untracked_or_if_its_recording_lacks_something(
    recorder, statuses, stopped, expected
):
    seen = view(recorder, 0)
    seen.live.trackers["sheet"] = log(*statuses)
    assert outcome.code(seen, stopped) is expected
