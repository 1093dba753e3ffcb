"""Views that repeat a pose of the board change neither what is counted, nor the deviations, nor the verdict."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.board.views import CornerView
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.diagnoses import ViewsError
from calib.solve.solution import Solution
from calib.solve.validation.cross_validation import TooFewToSplitError, cross_validate
from calib.solve.validation.verdict import Assessment, assess
from evaluation.scenes.boards import board_views
from evaluation.scenes.boards.bent import bent

SHOTS = 18


SIGMA = 0.1


@cache
def views(shots: int = SHOTS) -> tuple[CornerView, ...]:
    """Corners without noise that err together in each view, as on a board that is bent by hand."""
    generator = np.random.default_rng(2)
    camera = replace(board_views.three_heads()["color"].camera, T_rs=np.eye(4))
    head = board_views.Head(camera, 1e-9)
    seen = board_views.look({"color": head}, board_views.random_boards(shots, generator), generator)
    return tuple(replace(bent(view, 1.0, generator), sigma_px=SIGMA) for view in seen.corners)


def repeated(seen: Sequence[CornerView], times: int, noise: str = "fresh") -> list[CornerView]:
    """Each view again and again, as in a recording of a board that is held still, or the same files."""
    generators = [np.random.default_rng(number if noise == "fresh" else 0) for number in range(times)]
    return [
        replace(
            view, shot=times * view.shot + number, pixels=view.pixels + generator.normal(0, SIGMA, view.pixels.shape)
        )
        for view in seen
        for number, generator in enumerate(generators)
    ]


def task(seen: Sequence[CornerView]) -> Task:
    return Task({"color": SensorTask(1280, 720)}, seen, (), "color")


def solved(seen: Sequence[CornerView]) -> Solution:
    return calibrate(task(seen))


@cache
def solved_once() -> Solution:
    return solved(repeated(views(), 1))


@cache
def assessed_once() -> Assessment:
    return assess(solved_once(), 1.0, 1.0)


@pytest.mark.parametrize(("times", "noise"), [(2, "the same"), (2, "fresh"), (5, "fresh")])
def test_the_same_views_again_do_not_make_a_calibration_trusted(times: int, noise: str) -> None:
    once = assessed_once()
    again = assess(solved(repeated(views(), times, noise)), 1.0, 1.0)
    assert not once.trusted
    assert not again.trusted, again.verdict
    (alone,), (other,) = once.agreements, again.agreements
    assert other.difference_px == pytest.approx(alone.difference_px, rel=0.15)
    assert other.predicted_px == pytest.approx(alone.predicted_px, rel=0.15)


def test_the_same_views_again_do_not_make_deviations_smaller() -> None:
    once, again = solved_once(), solved(repeated(views(), 3, "the same"))
    for before, after in zip(once.parameters[:9], again.parameters[:9], strict=True):
        assert after.sigma == pytest.approx(before.sigma, rel=0.03), before.name


def test_four_poses_twice_are_four() -> None:
    with pytest.raises(ViewsError, match=r"color: 8 views of 4 distinct poses of the board; at least 6 poses"):
        solved(repeated(views()[:4], 2))
    with pytest.raises(TooFewToSplitError, match="6 distinct poses"):
        cross_validate(solved(repeated(views()[:6], 2)), 1.0, lambda _: None)


def test_halves_that_are_chosen_share_no_pose_of_the_board() -> None:
    solution = solved(repeated(views(10), 2))
    (found,) = cross_validate(solution, 1.0, lambda _: None, {*range(10)})
    (other,) = cross_validate(solution, 1.0, lambda _: None)
    assert 0 < found.difference_px != other.difference_px
    with pytest.raises(TooFewToSplitError, match="shots 10 and 11 show one pose"):
        cross_validate(solution, 1.0, lambda _: None, {*range(11)})
    with pytest.raises(TooFewToSplitError, match="3 and 7 distinct poses"):
        cross_validate(solution, 1.0, lambda _: None, {*range(6)})
