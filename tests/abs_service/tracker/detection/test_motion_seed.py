"""The region seed by motion: what moves in front of the scene."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.initial_detection import DetectionError, UndecidedError
from abs_service.tracker.detection.regions import seed
from calib.camera import Camera

DEPTH = Camera(160, 120, 140.0, 140.0, 79.5, 59.5)


def moving(k: int, column: int, row: int = 40) -> DepthView:
    """Image k of 30 in a second: a thing at 1 m in a column, another that rests, and a wall at 2 m; with noise."""
    distance = 2.0 + np.random.default_rng(k).normal(0, 0.003, (120, 160))
    distance[70:110, 100:140] -= 0.8
    distance[row : row + 30, column : column + 30] -= 1.0
    distance[np.random.default_rng(k + 1).uniform(size=distance.shape) < 0.02] = np.nan
    return DepthView.of(distance.astype(np.float32), DEPTH, t_ns=round(k * 1e9 / 30))


def test_what_moves_is_found_and_what_rests_is_not():
    region = seed.Settings(motion_s=1.0).build()
    for k in range(30):
        with pytest.raises(UndecidedError, match=r"in the images of 1 s, of which \d\.\d\d s are there"):
            region.select(moving(k, 20))
    for k in range(30, 40):
        with pytest.raises(DetectionError, match=r"nothing moved by 0\.02 m .* in 1 s"):
            region.select(moving(k, 20))
    for k in range(40, 55):
        column = 20 + (k - 40)
        try:
            selected = region.select(moving(k, column))
        except DetectionError:
            continue
        truth = np.zeros((120, 160), bool)
        truth[40:70, column : column + 30] = True
        assert np.count_nonzero(selected & truth) > 0.7 * np.count_nonzero(selected | truth)
        return
    pytest.fail("nothing moved")


def test_a_far_wall_that_changes_by_its_noise_has_not_moved():
    region = seed.Settings(motion_s=1.0).build()

    def wall(k: int) -> DepthView:
        shared = np.kron(np.random.default_rng(k).normal(0, 0.03, (6, 8)), np.ones((20, 20)))  # as of a stereo camera
        view = DepthView.of((3.5 + shared).astype(np.float32), DEPTH, t_ns=round(k * 1e9 / 30))
        return replace(view, deviation=0.03)

    for k in range(31):
        with pytest.raises(DetectionError):
            region.select(wall(k))
    with pytest.raises(DetectionError, match=r"nothing moved by 0\.02 m"):
        region.select(wall(31))


def test_motion_is_compared_anew_after_a_break():
    region = seed.Settings(motion_s=1.0).build()
    for k in range(31):
        with pytest.raises(DetectionError):
            region.select(moving(k, 20))
    with pytest.raises(UndecidedError, match=r"0\.00 s"):
        region.select(moving(300, 60))


def on_the_floor(k: int, away: float) -> DepthView:
    """Image k of 30 in a second: a floor before a wall at 2 m, and a person who walks on it at a distance."""
    row = np.arange(120)[:, None] + np.zeros(160)
    distance = np.where(row > 60, 2.0 - 0.008 * (row - 60), 2.0)
    column = 20 + k
    moving = slice(30, 100), slice(column, column + 20)
    distance[moving] = np.minimum(distance[moving], away)
    return DepthView.of(distance.astype(np.float32), DEPTH, t_ns=round(k * 1e9 / 30))


def test_what_moves_on_a_floor_that_is_most_of_the_image_is_not_the_scene():
    """Feet and floor are one surface, and floor and wall: all of them were tracked, and said to be the object."""
    region = seed.Settings(motion_s=1.0).build()
    for k in range(30):
        with pytest.raises(UndecidedError):
            region.select(on_the_floor(k, 1.69))
    with pytest.raises(DetectionError, match=r"what moved is connected to \d+% of all returns, .* that is the scene"):
        region.select(on_the_floor(30, 1.69))


def test_an_object_that_fills_the_image_may_move():
    region = seed.Settings(motion_s=1.0).build()

    def nearer(k: int) -> DepthView:
        return DepthView.of(np.full((120, 160), 1.5 - 0.005 * k, np.float32), DEPTH, t_ns=round(k * 1e9 / 30))

    for k in range(30):
        with pytest.raises(UndecidedError):
            region.select(nearer(k))
    assert region.select(nearer(30)).all()
