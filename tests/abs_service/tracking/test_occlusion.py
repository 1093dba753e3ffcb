"""A hand that crosses the sheet does not drag it along."""

import pytest

from evaluation.method.occlusion import measure


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_what_stays_visible_is_tracked_as_well_as_without_the_hand(seed):
    found = measure(seed, frames=170)
    print(f"seed {seed}: {found}")
    assert found.share > 0.2
    assert found.visible_mm < 1.5 * found.plain_mm
    assert found.occluded_mm < 10
