"""Pictures of two shots that were exchanged are named, and nothing else."""

import numpy as np
import pytest

from calib.calibration_check import changes
from calib.calibration_check.board_poses import solve
from calib.calibration_check.changes import PairChange, pair_changes
from calib.calibration_check.stored_calibration import Stored, Views
from calib.solve.bundle.adjustment import NotSolvedError
from calib.solve.bundle.parameters.state import SensorState
from calib.solve.validation.inconsistent_shots.contradictions import Contradiction, contradictions
from evaluation.scenes.boards.board_views import look, random_boards, three_heads


@pytest.fixture
def exchanged() -> tuple[Stored, Views]:
    """Two heads that have not moved, and twelve shots; the second head's pictures of shots 4 and 9 are exchanged."""
    heads = {name: head for name, head in three_heads().items() if name != "tof"}
    random = np.random.default_rng(3)
    boards = random_boards(12, random)
    first = look({"light": heads["light"]}, boards, random)
    late = look({"color": heads["color"]}, {**boards, 4: boards[9], 9: boards[4]}, random)
    stored = Stored({name: SensorState(head.camera) for name, head in heads.items()})
    return stored, Views((*first.corners, *late.corners), ())


def assert_named(change: PairChange) -> None:
    assert sorted(one.shot for one in change.contradicting) == [4, 9]
    assert change.shots == 10
    assert change.shift_px < 0.5


def test_also_if_the_search_with_them_ends_nowhere(exchanged, monkeypatch):
    def unsolved(stored, views, moving):  # as on some processors: where it ended tells nothing
        if moving and {4, 9} & views.shots["color"]:
            raise NotSolvedError("no minimum", None)
        return solve(stored, views, moving)

    monkeypatch.setattr(changes, "solve", unsolved)
    (change,) = pair_changes(*exchanged)
    assert_named(change)


def test_no_shot_that_contradicts_only_what_they_have_distorted(exchanged, monkeypatch):
    """As with another SciPy: the solution of all shots missed everywhere by 25 px."""

    def distorted(solution):
        found = contradictions(solution)
        if {4, 9} <= {*solution.task.shots}:
            return [*found, Contradiction(1, ("light",), 60.0, 25.0, "corners")]
        return found

    monkeypatch.setattr(changes, "contradictions", distorted)
    (change,) = pair_changes(*exchanged)
    assert_named(change)
    assert all(one.median < 1 < one.miss for one in change.contradicting)
