"""A print that is longer along one axis, and a bent board, are named with their size."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation.board_shape import shape_errors
from calib.solve.validation.verdict import MAX_RATIO, RADIUS_95, assess
from tests.calib.solve import board_views


@cache
def solved(stretch: float = 1.0, bend: float = 0.0) -> Solution:
    """Solution from images of a board whose rows are longer, or whose left and right edges are bent back [m]."""
    generator = np.random.default_rng(1)
    camera = replace(board_views.three_heads()["color"].camera, T_rs=np.eye(4))
    points_b = board_views.board_points()
    made = points_b * (stretch, 1, 1)
    made[:, 2] = bend * (points_b[:, 0] / 0.16 - 1) ** 2
    seen = []
    for shot, T_rb in board_views.random_boards(24, generator).items():
        (view,) = board_views.corners("color", board_views.Head(camera, 0.1), shot, T_rb, generator, shot) or (None,)
        if view is not None and len(view.pixels) == len(made):
            pixels = board_views.projected(camera, T_rb, made) + generator.normal(0, 0.1, (len(made), 2))
            seen.append(replace(view, pixels=pixels))
    inside = [view for view in seen if view.pixels.min() > 0 and np.all(view.pixels.max(axis=0) < (1279, 719))]
    return calibrate(Task({"color": SensorTask(1280, 720)}, inside, (), "color"))


def test_a_board_as_described_has_no_error() -> None:
    assert shape_errors(solved(), 1.0, 1.0) == []


@pytest.mark.parametrize(("stretch", "longer"), [(1.01, "rows"), (0.99, "columns"), (1.005, "rows")])
def test_a_print_that_is_scaled_along_one_axis_is_named_with_its_size(stretch: float, longer: str) -> None:
    found = shape_errors(solved(stretch), 1.0, 1.0)
    (one,) = found
    assert one.stretch
    assert one.size == pytest.approx(100 * (stretch - 1), rel=0.35)
    assert assess(solved(stretch), 1.0, 1.0).verdict.startswith(f"Do not trust it yet: the board's {longer} are ")


def test_a_bend_that_hardly_shows_in_the_middle_of_the_boards_distances_is_named() -> None:
    (found,) = shape_errors(solved(bend=0.0002), 1.0, 1.0)
    assert not found.stretch
    assert abs(found.size) == pytest.approx(0.2, rel=0.35)


def test_a_bent_board_is_named_with_its_size() -> None:
    (found,) = shape_errors(solved(bend=0.002), 1.0, 1.0)
    assert not found.stretch
    assert abs(found.size) == pytest.approx(2, rel=0.35)
    assert any(reason.startswith("a board that is bent by ") for reason in assess(solved(bend=0.002), 1.0, 1.0).reasons)


def test_halves_that_differ_beyond_chance_say_how_well_projections_are_known() -> None:
    found = assess(solved(), 1.0, 2.0)
    (halves,) = found.agreements
    assert halves.ratio > MAX_RATIO
    assert f"are known to {RADIUS_95 * found.images['color'].rms * halves.ratio:.2g} px (95 %)" in found.verdict
