"""The gripper holds still when the camera stalls, and goes on when the service has opened it again."""

import time

import pytest
from gripper.hold import targets

LIMIT_S = 60.0

pytestmark = pytest.mark.abs_rig(seed=3, fault="stall@150")


def test_the_gripper_holds_still_while_the_camera_is_silent_and_goes_on(abs_rig):
    seen, end_s = [], time.monotonic() + LIMIT_S
    with abs_rig.states() as states:
        for target in targets(states):
            said = "hold" if target is None else "follow"
            if seen[-1:] != [said]:
                seen.append(said)
            if seen[-3:] == ["follow", "hold", "follow"] or time.monotonic() > end_s:
                break
    assert seen[-3:] == ["follow", "hold", "follow"]
