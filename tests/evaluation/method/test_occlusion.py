"""A hand that crosses the sheet does not drag it along."""

import pytest

from evaluation.method.occlusion import measure


@pytest.mark.slow
def test_what_stays_visible_is_tracked_as_well_as_without_the_hand():
    found = measure(2, frames=170)  # seed 1 is the quick form of the experiment
    print(found)
    assert found.share > 0.2
    assert found.visible_mm < 1.5 * found.plain_mm
    assert found.occluded_mm < 10
