"""Prints that are not as described, and bent boards, are named with their size."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from calib.board.april_grid import AprilGrid
from calib.board.views import CornerView
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation.board_shape import Shape, shape_errors
from calib.solve.validation.verdict import MAX_RATIO, RADIUS_95, assess
from evaluation.scenes.boards import board_views


@cache
def solved(stretch: float = 1.0, bend: float = 0.0, power: int = 2) -> Solution:
    """Solution from images of a board whose rows are longer, or whose edges are bent back, odd powers: one forward."""
    points_b = board_views.board_points()
    made = points_b * (stretch, 1, 1)
    made[:, 2] = bend * (points_b[:, 0] / 0.16 - 1) ** power
    return photographed(points_b, made)


def photographed(described: NDArray[np.float64], made: NDArray[np.float64]) -> Solution:
    """Solution from images of a board whose points (n, 3) are elsewhere than described [m]."""
    generator = np.random.default_rng(1)
    camera = replace(board_views.three_heads()["color"].camera, T_rs=np.eye(4))
    seen = []
    for shot, T_rb in board_views.random_boards(24, generator).items():
        pixels = board_views.projected(camera, T_rb, made) + generator.normal(0, 0.1, (len(made), 2))
        if pixels.min() > 0 and np.all(pixels.max(axis=0) < (1279, 719)):
            seen.append(CornerView("color", shot, float(shot), described, pixels))
    return calibrate(Task({"color": SensorTask(1280, 720)}, seen, (), "color"))


def test_a_board_as_described_has_no_error() -> None:
    assert shape_errors(solved(), 1.0, 1.0) == []


@pytest.mark.parametrize(("stretch", "longer"), [(1.01, "rows"), (0.99, "columns"), (1.005, "rows")])
def test_a_print_that_is_scaled_along_one_axis_is_named_with_its_size(stretch: float, longer: str) -> None:
    found = shape_errors(solved(stretch), 1.0, 1.0)
    (one,) = found
    assert one.shape == Shape.STRETCH
    assert one.size == pytest.approx(100 * (stretch - 1), rel=0.35)
    assert assess(solved(stretch), 1.0, 1.0).verdict.startswith(f"Do not trust it yet: the board's {longer} are ")


def test_a_print_without_right_angles_is_named_with_its_angle() -> None:
    points_b = board_views.board_points()
    solution = photographed(points_b, points_b @ np.array([[1, 0, 0], [0.01, 1, 0], [0, 0, 1]]))
    (found,) = shape_errors(solution, 1.0, 1.0)
    assert found.shape == Shape.SKEW
    assert abs(found.size) == pytest.approx(1, rel=0.2)
    assert "rows and columns are 0.5" in assess(solution, 1.0, 1.0).verdict


def keystone(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """A page that was photographed or scanned askew: its lower rows are longer."""
    return np.stack([x * y, np.zeros_like(x)], axis=1)


def uneven_feed(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """A page that slipped in the printer: squares become larger from one side to the other."""
    return np.stack([x**2, np.zeros_like(y)], axis=1)


@pytest.mark.parametrize("displaced", [keystone, uneven_feed])
def test_an_uneven_print_is_named_with_its_size(
    displaced: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]],
) -> None:
    """A keystone of 2 % was trusted: projections were 2.9 px off where 0.5 px were promised."""
    points_b = board_views.board_points()
    half = np.ptp(points_b[:, 0]) / 2
    made = points_b.copy()
    made[:, :2] += 0.0008 * displaced(points_b[:, 0] / half - 1, (points_b[:, 1] - np.ptp(points_b[:, 1]) / 2) / half)
    solution = photographed(points_b, made)
    named = shape_errors(solution, 1.0, 1.0)
    assert named[0].shape == Shape.UNEVEN
    assert abs(named[0].size) == pytest.approx(0.8, rel=0.2)
    assert "Do not trust it yet: the print is uneven: from its middle " in assess(solution, 1.0, 1.0).verdict


@pytest.mark.parametrize(("gap", "than"), [(0.0095, "smaller"), (0.0115, "larger")])
def test_tags_that_are_not_as_large_as_described_beside_their_gaps_are_named(gap: float, than: str) -> None:
    made, described = AprilGrid(6, 5, 0.045, 0.0105), AprilGrid(6, 5, 0.045, gap)
    solution = photographed(described.points(), made.points())
    (found,) = shape_errors(solution, 1.0, 1.0)
    assert found.shape == Shape.TAGS
    # Sizes count by the distances of the tags' centres.
    assert found.size == pytest.approx(100 * ((0.045 + gap) / (0.045 + 0.0105) - 1), rel=0.1)
    assert assess(solution, 1.0, 1.0).verdict.startswith("Do not trust it yet: tags are ")
    assert f"% {than} than described" in str(found)


def test_tags_that_hardly_move_projections_are_named_as_lengths_are_wrong_by_as_much() -> None:
    made, described = AprilGrid(6, 5, 0.045, 0.0105), AprilGrid(6, 5, 0.045, 0.0101)
    solution = photographed(described.points(), made.points())
    (found,) = shape_errors(solution, 1.0, 20.0)
    assert found.effect_px < 0.15 * 20
    assert found.size == pytest.approx(-0.72, rel=0.15)
    assert "and all lengths by as many per cent" in str(found)


def test_an_april_grid_as_described_has_no_error() -> None:
    points = AprilGrid(6, 5, 0.045, 0.0105).points()
    assert shape_errors(photographed(points, points), 1.0, 1.0) == []


def test_a_bend_that_hardly_shows_in_the_middle_of_the_boards_distances_is_named() -> None:
    (found,) = shape_errors(solved(bend=0.0002), 1.0, 1.0)
    assert found.shape == Shape.BEND
    assert abs(found.size) == pytest.approx(0.2, rel=0.35)


def test_a_bent_board_is_named_with_its_size() -> None:
    (found,) = shape_errors(solved(bend=0.002), 1.0, 1.0)
    assert found.shape == Shape.BEND
    assert abs(found.size) == pytest.approx(2, rel=0.35)
    assert any(reason.startswith("a board that is bent by ") for reason in assess(solved(bend=0.002), 1.0, 1.0).reasons)


def test_a_board_that_is_bent_to_both_sides_is_named_with_its_size() -> None:
    """On a fisheye, projections were 1.1 px off where 0.56 px were promised."""
    (found,) = shape_errors(solved(bend=0.003, power=3), 1.0, 1.0)
    assert found.shape == Shape.BEND
    assert abs(found.size) == pytest.approx(3, rel=0.35)
    assert not assess(solved(bend=0.003, power=3), 1.0, 1.0).trusted


def test_halves_that_differ_beyond_chance_say_how_well_projections_are_known() -> None:
    found = assess(solved(bend=0.001), 1.0, 10.0)  # a bend that does not matter where 10 px suffice
    (halves,) = found.agreements
    assert halves.ratio > MAX_RATIO
    assert f"are known to {RADIUS_95 * found.images['color'].rms * halves.ratio:.2g} px (95 %)" in found.verdict
