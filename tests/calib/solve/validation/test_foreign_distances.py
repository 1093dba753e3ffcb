"""Distances that are not those of the boards are named: they were trusted, as they counted for nothing."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calib.board.views import PlaneView
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.validation.inconsistent_shots.foreign_distances import foreign_distances
from calib.solve.validation.verdict import assess
from evaluation.scenes.boards import board_views

HEADS = {name: head for name, head in board_views.three_heads().items() if name != "light"}
CORNER = np.array([HEADS["tof"].camera.width, HEADS["tof"].camera.height]) - 1


def assessed(spoil: Callable[[PlaneView], PlaneView]) -> tuple[str, int]:
    """Verdict, and number of sensors with foreign distances."""
    random = np.random.default_rng(3)
    seen = board_views.look(HEADS, board_views.random_boards(18, random), random, points=60)
    sensors = {name: SensorTask(head.camera.width, head.camera.height) for name, head in HEADS.items()}
    solution = calibrate(Task(sensors, seen.corners, [spoil(view) for view in seen.planes], "tof"))
    return assess(solution, 1.0, 1.0).verdict, len(foreign_distances(solution))


def in_millimetres(view: PlaneView) -> PlaneView:
    return replace(view, distances=view.distances * 1000, sigmas=view.sigmas * 1000)


def mirrored(view: PlaneView) -> PlaneView:
    return replace(view, pixels=np.stack([CORNER[0] - view.pixels[:, 0], view.pixels[:, 1]], axis=1))


def turned(view: PlaneView) -> PlaneView:
    return replace(view, pixels=CORNER - view.pixels)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (in_millimetres, "tof: its distances are 1000 times as long as those of the boards"),
        (mirrored, "tof: its distances miss the boards by "),
        (turned, "tof: its distances miss the boards by "),
    ],
)
def test_they_are_named(spoil: Callable[[PlaneView], PlaneView], said: str) -> None:
    verdict, count = assessed(spoil)
    assert verdict.startswith(f"Do not trust it yet: {said}")
    assert "e+" not in verdict
    assert count == 1


def flying(view: PlaneView) -> PlaneView:
    """Every fourth distance is behind the board, as at the edges of a squared pattern."""
    behind = np.where(np.arange(len(view.distances)) % 4 == 0, 0.2, 0.0)
    return replace(view, distances=view.distances + behind)


@pytest.mark.parametrize(
    "spoil",
    [replace, flying, lambda view: replace(view, distances=view.distances + 0.03)],
    ids=["as they are", "with flying pixels", "with an offset"],
)
def test_distances_of_the_boards_are_not(spoil: Callable[[PlaneView], PlaneView]) -> None:
    assert assessed(spoil)[1] == 0
