"""A check of what a solve has stored: intrinsics and pose that are wrong together are no motion, and hide none."""

from functools import cache

import numpy as np
import pytest

from calib import pose
from calib.calibration_check.changes import QUANTILE, PairChange, pair_changes
from calib.calibration_check.comparison import compare
from calib.calibration_check.hypotheses import Kind
from calib.calibration_check.stored_calibration import Stored, Views
from calib.camera import Camera
from calib.solve.bundle.parameters.layout import POSE
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from evaluation.scenes.boards.board_views import Head, look, random_boards

#: Where the boards are: at calibration, and at checks much nearer, much further, and there again [m].
CALIBRATED = (0.7, 1.3)
CHECKED = {"nearer": (0.5, 0.7), "further": (1.5, 2.0), "there": CALIBRATED}


def heads(turn: float = 0.0) -> dict[str, Head]:
    """A stereo pair, of which the second is turned about its y axis [rad]."""
    left = Camera(640, 480, 700.0, 700.0, 322.0, 238.0)
    T_rs = pose.from_rotation_vector((0.0, 0.02 + turn, 0.0), (0.08, 0.0, 0.0))
    return {"left": Head(left, 0.15), "right": Head(Camera(640, 480, 702.0, 701.0, 318.0, 243.0, T_rs=T_rs), 0.15)}


@cache
def stored(seed: int) -> Stored:
    """The pair as a solve of twelve shots with free intrinsics stores it."""
    random = np.random.default_rng(seed)
    seen = look(heads(), random_boards(12, random, *CALIBRATED), random)
    solution = calibrate(Task({name: SensorTask(640, 480) for name in heads()}, seen.corners, (), "left"))
    layout = solution.adjustment.layout
    own = slice(0, layout.board_start)
    return Stored(solution.state.sensors, layout.names[own], solution.covariance[own, own])


def views(seed: int, turn: float, where: str) -> Views:
    """Ten shots of the pair."""
    random = np.random.default_rng(1000 + seed)
    return Views(look(heads(turn), random_boards(10, random, *CHECKED[where]), random).corners, ())


def checked(seed: int, turn: float, where: str) -> PairChange:
    """Change of the pair in new shots."""
    (change,) = pair_changes(stored(seed), views(seed, turn, where))
    return change


@pytest.mark.parametrize("where", CHECKED)
def test_a_pair_that_did_not_move_raises_no_alarm_wherever_the_boards_are(where: str) -> None:
    found = [checked(seed, 0.0, where) for seed in range(3)]
    assert not any(change.is_significant for change in found), [change.squared for change in found]


def test_a_turn_is_told_that_a_principal_point_could_hide_at_calibration() -> None:
    turn = np.deg2rad(0.1)
    change = checked(0, turn, "there")
    rows = [stored(0).names.index(f"right.{name}") for name in POSE]
    every = stored(0).covariance
    assert every is not None
    motion = np.concatenate([change.turn, change.move])
    assert motion @ np.linalg.solve(every[np.ix_(rows, rows)], motion) < QUANTILE
    assert change.is_significant
    assert change.sigma_px < 0.3
    np.testing.assert_allclose(change.turn, (0.0, turn, 0.0), atol=3e-4)
    assert compare(stored(0), views(0, turn, "there")).chosen.hypothesis.kind == Kind.MOVED
