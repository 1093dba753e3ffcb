"""The exit code of `run` says whether its recordings are complete."""

from pathlib import Path

import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.commands import run
from abs_service.supervision.child import Child, State
from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.rig_state import RigState
from abs_service.supervision.rig_view import RigView


def view(code, *failures):
    """A rig whose recorder ended with this code, after processes of it that said so many failures each."""
    live = RigState([], lambda: 0)
    for boot, number in enumerate(failures):
        said = Health(component="record", header=Header(boot_id=str(boot)), counters={"failures": number})
        live.take(Sample(keys.health("record"), Health.DESCRIPTOR.full_name, said.SerializeToString()))
    ended = Child("record", (), 0, State.STOPPED, worst_code=code)
    return RigView("bench", "", Path(), live, [ended], 0.0, 0, "")


@pytest.mark.parametrize(("code", "expected"), [(0, Exit.OK), (1, Exit.FAILED), (137, Exit.FAILED)])
def test_the_recorders_own_code_counts(code, expected):
    assert run.recording_code(view(code, 0)) is expected


def test_a_failure_counts_though_the_recorder_that_had_it_was_killed():
    assert run.recording_code(view(0, 1, 0)) is Exit.FAILED
    assert run.recording_code(view(0, 0, 0)) is Exit.OK
