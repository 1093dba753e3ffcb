"""E3 in seconds: an offset that static walls have told costs nothing; unknown, it is an error of its own size."""

import pytest

from evaluation.experiment import Context
from evaluation.paper import offset


@pytest.mark.slow
def test_an_offset_that_is_known_is_compensated():
    findings = offset.run(offset.QUICK, Context(0))
    for goal in findings.goals:
        assert goal.met, goal
    assert findings.values["NURBS, likelihood that knows the offset"]["vertex_mm"] < 2
    # Nothing in the images tells of it, so that nobody is warned.
    assert findings.values["NURBS, likelihood that does not"]["surface_mm"] > 90
    assert findings.values["NURBS, likelihood that does not"]["tracked"] == 1
