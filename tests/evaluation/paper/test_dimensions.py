"""E6 in seconds, and that a sheet in waves is as long as a flat one."""

import numpy as np
import pytest

from evaluation.experiment import Context
from evaluation.paper import dimensions
from evaluation.scenes.waves import Waves


@pytest.mark.parametrize("t", [0.0, 2.0, 2.9])
def test_a_sheet_in_waves_keeps_its_lengths(t):
    points = Waves(seed=1).points(t)
    for axis, spacing in ((0, 0.2 / 240), (1, 0.3 / 360)):
        lengths = np.linalg.norm(np.diff(points, axis=axis), axis=-1)
        np.testing.assert_allclose(lengths, spacing, rtol=2e-4)
    assert np.ptp(points[..., 2]) > 0.02 or t == 0


@pytest.mark.slow
def test_more_dimensions_follow_what_fewer_cannot():
    findings = dimensions.run(dimensions.QUICK, Context(0))
    for goal in findings.goals:
        assert goal.met, goal
    # Where the print is seen, few generations do: they begin there.
    evolutions = [findings.values[f"CMA-ES, {generations} × 18"]["vertex_mm"] for generations in (10, 30)]
    assert max(evolutions) < 1.1 * findings.values["6 × 6"]["vertex_mm"]
    assert findings.values["6 × 6"]["dimensions"] == 108
