"""One sensor more never makes the mean error worse by more than 5 %, though no weight says how much each is worth."""

import numpy as np
import pytest

from evaluation.experiment import Context
from evaluation.inputs import sensors

TOF = "color + tof"


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_another_sensor_does_no_harm() -> None:
    found = sensors.run(sensors.Settings(6, 50, sensors.QUICK.subsets), Context(0))  # single ones scatter by a third
    assert all(goal.met for goal in found.goals), found.goals
    assert all("of 7 ratios" in goal.name for goal in found.goals)
    errors = found.values["errors_mm"]
    # One that is twice as good is worth it, although the priors (averaged offsets, smooth motion, little stretch) help
    # the single one more.
    assert np.all(errors["color + structured_light + tof"].mean(axis=0) < 0.95 * errors[TOF].mean(axis=0))
