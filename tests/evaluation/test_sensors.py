"""One sensor more never makes the mean error worse by more than 5 %, though no weight says how much each is worth."""

import numpy as np
import pytest

from tests.evaluation.sensors import Scene, Subset, ratios

WORST = 1.05
TOF, LIGHT = frozenset({"tof", "color"}), frozenset({"structured_light", "color"})
#: With colour in all of them: without it the sheet slides along itself, and how far is chance.
COMPARED: tuple[Subset, ...] = (
    TOF,
    LIGHT,
    TOF | LIGHT,
    TOF | {"barrier"},
    LIGHT | {"barrier"},
    TOF | LIGHT | {"barrier"},
)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_another_sensor_does_no_harm():
    scenes = [Scene(seed, 60) for seed in (1, 2)]
    errors = {subset: np.array([scene.errors(subset) for scene in scenes]) for subset in COMPARED}
    for column in range(2):  # vertex and surface error
        found = ratios({subset: of_seeds[:, column] for subset, of_seeds in errors.items()})
        assert len(found) == 7
        assert max(found.values()) < WORST, found
        assert found[TOF, "structured_light"] < 0.7  # and one that is twice as good is worth what it is
