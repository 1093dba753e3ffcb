"""A stored calibration against new views: no alarm without reason, and the sensor that moved is named."""

from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from calib.calibration_check.changes import pair_changes
from calib.calibration_check.hypotheses import (
    MotionHypothesis,
    corner_fit,
    distance_bias,
    motion_hypotheses,
    moved_candidates,
)
from calib.calibration_check.stored import CalibrationCheckError, Stored, Views, usable
from calib.camera import Camera
from calib.solve.bundle.layout import POSE
from calib.solve.bundle.state import SensorState
from tests.calib.solve.board_views import Head, look, random_boards, three_heads

SIGMAS = {"light": (2e-4, 2e-4), "color": (2e-4, 2e-4)}


def stored(heads: dict[str, Head]) -> Stored:
    names = tuple(f"{sensor}.{name}" for sensor in SIGMAS for name in POSE)
    sigmas = np.concatenate([np.repeat(SIGMAS[sensor], 3) for sensor in SIGMAS])
    return Stored({name: SensorState(head.camera) for name, head in heads.items()}, names, np.diag(sigmas**2))


def moved(camera: Camera, turn: tuple[float, ...], move: tuple[float, ...]) -> Camera:
    T_rs = pose.from_rotation_vector(turn, (0, 0, 0)) @ camera.T_rs
    T_rs[:3, 3] = camera.T_rs[:3, 3] + move
    return replace(camera, T_rs=T_rs)


def seen(heads: dict[str, Head], seed: int, count: int = 8) -> Views:
    random = np.random.default_rng(seed)
    found = look(heads, random_boards(count, random), random)
    return Views(found.corners, found.planes)


def test_a_rig_that_did_not_move_raises_no_alarm() -> None:
    heads = three_heads()
    for seed in range(2):
        changes = pair_changes(stored(heads), seen(heads, seed))
        assert {(one.first, one.second) for one in changes} == {("tof", "light"), ("tof", "color"), ("light", "color")}
        assert not any(one.is_significant for one in changes)
        assert all(one.shift_px < 4 * one.sigma_px for one in changes)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["tof", "color"])
def test_the_sensor_that_moved_is_named_with_how_far(sensor: str) -> None:
    heads = three_heads()
    before = stored(heads)
    turn, move = (0.004, -0.003, 0.002), (0.003, 0.002, -0.004)
    heads[sensor] = replace(heads[sensor], camera=moved(heads[sensor].camera, turn, move))
    views = seen(heads, 7)
    for one in pair_changes(before, views):
        assert one.is_significant == (sensor in {one.first, one.second})
        if one.second == sensor:
            np.testing.assert_allclose(one.turn, turn, atol=6e-4)
            np.testing.assert_allclose(one.move, move, atol=1e-3)
    explanations = motion_hypotheses(before, views)
    assert moved_candidates(explanations) == [sensor]
    assert explanations[sensor].share > 0.95


def test_two_sensors_cannot_tell_which_of_them_moved() -> None:
    heads = {name: head for name, head in three_heads().items() if name != "tof"}
    before = Stored({name: SensorState(head.camera) for name, head in heads.items()})
    heads["color"] = replace(heads["color"], camera=moved(heads["color"].camera, (0, 0, 0), (0.01, 0, 0)))
    assert moved_candidates(motion_hypotheses(before, seen(heads, 12))) == ["light", "color"]
    assert moved_candidates({"a": MotionHypothesis(0.5, 1e4), "b": MotionHypothesis(0.6, 9e3)}) == []


def test_a_stored_calibration_that_was_uncertain_does_not_count_as_moved() -> None:
    """The same displacement is no news where the stored deviation is as large."""
    heads = three_heads()
    before = stored(heads)
    heads["color"] = replace(heads["color"], camera=moved(heads["color"].camera, (0, 0, 0), (0.003, 0, 0)))
    views = seen(heads, 8)
    (sure,) = [one for one in pair_changes(before, views) if one.second == "color" and one.first == "light"]
    vague = replace(before, covariance=np.diag(np.full(12, 0.003**2)))
    (unsure,) = [one for one in pair_changes(vague, views) if one.second == "color" and one.first == "light"]
    assert sure.is_significant
    assert not unsure.is_significant
    assert unsure.sigma_px > 5 * sure.sigma_px


def test_a_lens_that_was_turned_shows_in_the_camera_s_own_corners() -> None:
    heads = three_heads()
    before = stored(heads)
    sharp = corner_fit(before, seen(heads, 9), "color")
    assert sharp.rms == pytest.approx(0.1 * np.sqrt(2), rel=0.2)
    camera = heads["color"].camera
    heads["color"] = replace(heads["color"], camera=replace(camera, fx=0.9 * camera.fx))
    assert corner_fit(before, seen(heads, 9), "color").rms > 5 * sharp.rms


def test_a_sensor_of_distances_only_is_compared_too() -> None:
    heads = three_heads()
    before = stored(heads)
    heads["light"] = replace(
        heads["light"], corner_sigma=0.0, camera=moved(heads["light"].camera, (0, 0, 0), (0, 0, 0.02))
    )
    changes = {(one.first, one.second): one for one in pair_changes(before, seen(heads, 10))}
    assert changes["tof", "light"].is_significant
    assert changes["tof", "light"].move[2] == pytest.approx(0.02, abs=0.003)
    assert not changes["tof", "color"].is_significant


def test_distances_that_are_off_are_told_from_corners() -> None:
    heads = three_heads()
    before = stored(heads)
    right = distance_bias(before, seen(heads, 11), "tof")
    heads["tof"] = replace(heads["tof"], depth_offset=0.02)
    wrong = distance_bias(before, seen(heads, 11), "tof")
    assert right is not None
    assert wrong is not None
    assert abs(right.mean) < 4 * right.sigma + 1e-3
    assert wrong.mean - right.mean == pytest.approx(0.02, abs=2e-3)
    assert distance_bias(before, seen(heads, 11), "color") is None


def test_views_that_show_no_board_are_refused() -> None:
    heads = three_heads()
    with pytest.raises(CalibrationCheckError, match="no view shows"):
        usable(stored(heads), Views([], seen(heads, 1).planes))
