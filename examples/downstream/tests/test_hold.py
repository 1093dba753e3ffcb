"""The gripper follows a sheet that a simulated rig tracks."""

import time
from itertools import islice

import numpy as np
import pytest
from gripper.hold import targets

pytestmark = pytest.mark.abs_rig(seed=3)


def test_the_gripper_follows_the_sheet(abs_rig):
    with abs_rig.states() as states:
        followed = [target for target in islice(targets(states), 40) if target is not None]
    assert len(followed) > 20
    assert np.linalg.norm(np.mean(followed, axis=0) - [0, 0, 1]) < 0.2  # where the simulator holds it


def test_a_slow_gripper_is_never_late(abs_rig):
    with abs_rig.states() as states:
        for _ in range(3):
            time.sleep(0.5)
            assert next(states).age_s < 0.5
