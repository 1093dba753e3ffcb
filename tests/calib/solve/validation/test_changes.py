"""A change of optics is named with its size only if the shots before and after confirm it."""

import numpy as np
import pytest

from calib.solve.solution import Solution
from calib.solve.validation import verdict
from calib.solve.validation.free_shape import free_shape
from calib.solve.validation.inconsistent_shots import findings
from calib.solve.validation.inconsistent_shots.changes import is_confirmed, unseen
from calib.solve.validation.inconsistent_shots.steadiness import Change, changes_of_optics
from tests.calib.solve.validation.test_steadiness import solved, views, zoomed

#: As was said of a fisheye that did not change, and of which four images at the border missed by 0.9 px.
ABSURD = Change("color", 12, np.array([-0.198, -46.4, 7.9]), 87.0)


def test_a_zoom_is_confirmed_and_a_step_of_any_size_is_not() -> None:
    solution = solved(zoomed(lambda shot: 0.985 if shot >= 12 else 1.0))
    (found,) = changes_of_optics(free_shape(solution), 1.0)
    assert is_confirmed(solution, found)
    assert not is_confirmed(solution, ABSURD)


def test_shots_that_disagree_otherwise_are_named_without_a_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(findings, "changes_of_optics", lambda free, needed_px: [ABSURD])
    said = verdict.assess(_unchanged(), 1.0, 1.0)
    assert not said.trusted
    assert said.verdict.startswith(
        "Do not trust it yet: color: shots from about 12 on disagree with those before, and not"
    )
    assert "87 px" not in said.verdict


def _unchanged() -> Solution:
    return solved(views())


def test_the_least_change_that_shows_is_not_rounded_to_none() -> None:
    """Of sharp images with 16 poses "a change of less than 0.0%" was said."""
    assert "half way of less than 0.1% would not have shown" in unseen({"color": 2e-4})
    assert "of left half way of less than 1.2%" in unseen({"left": 0.012, "right": 2e-4})
