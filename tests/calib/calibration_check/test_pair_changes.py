"""A stored calibration against new views: no alarm without reason, and the sensor that moved is named."""

from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from calib.calibration_check.changes import pair_changes
from calib.calibration_check.comparison import Comparison, compare
from calib.calibration_check.hypotheses import Kind
from calib.calibration_check.sensor_fits import corner_fit, distance_bias
from calib.calibration_check.stored_calibration import CalibrationCheckError, Stored, Views, usable
from calib.camera import Camera
from calib.solve.bundle.parameters.layout import POSE
from calib.solve.bundle.parameters.state import SensorState
from evaluation.scenes.boards.board_views import Head, look, random_boards, three_heads

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
        found = pair_changes(stored(heads), seen(heads, seed))
        assert {(one.first, one.second) for one in found} == {("tof", "light"), ("tof", "color"), ("light", "color")}
        assert not any(one.is_significant for one in found)
        assert all(one.shift_px < 4 * one.sigma_px for one in found)


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
    found = compare(before, views)
    assert named(found) == (Kind.MOVED, (sensor,))
    assert found.rivals == []
    np.testing.assert_allclose(found.chosen.values, (*turn, *move), atol=1e-3)


def test_two_sensors_cannot_tell_which_of_them_moved() -> None:
    heads = {name: head for name, head in three_heads().items() if name != "tof"}
    before = Stored({name: SensorState(head.camera) for name, head in heads.items()})
    heads["color"] = replace(heads["color"], camera=moved(heads["color"].camera, (0, 0, 0), (0.01, 0, 0)))
    found = compare(before, seen(heads, 12))
    assert {named(found), *rivals(found)} == {(Kind.MOVED, ("light",)), (Kind.MOVED, ("color",))}


@pytest.mark.parametrize("seed", range(3))
def test_nothing_that_changed_is_named_as_nothing(seed: int) -> None:
    heads = three_heads()
    assert named(compare(stored(heads), seen(heads, seed))) == (Kind.UNCHANGED, ())


@pytest.mark.parametrize(
    ("terms", "kind", "value"),
    [({"depth_scale": 0.01}, Kind.SCALE, 0.01), ({"depth_offset": 0.008}, Kind.OFFSET, 0.008)],
)
def test_distances_that_changed_are_no_motion(terms: dict[str, float], kind: Kind, value: float) -> None:
    heads = three_heads()
    before = stored(heads)
    heads["tof"] = replace(heads["tof"], **terms)
    found = compare(before, seen(heads, 3, 10))
    assert named(found) == (kind, ("tof",))
    assert abs(found.chosen.values[0] - value) < 4 * found.chosen.sigmas[0] < 0.1 * value


def aligned() -> dict[str, Head]:
    """A colour camera, and a depth image that was aligned to it: a sensor with its camera and no image of its own."""
    color = three_heads()["color"]
    return {"color": color, "depth": Head(color.camera, depth_sigma=0.004)}


def test_an_aligned_depth_image_that_is_too_long_has_not_moved() -> None:
    heads = aligned()
    before = Stored({name: SensorState(head.camera) for name, head in heads.items()})
    heads["depth"] = replace(heads["depth"], depth_scale=0.01)
    found = compare(before, seen(heads, 1, 10))
    assert named(found) == (Kind.SCALE, ("depth",))
    assert found.chosen.values[0] == pytest.approx(0.01, abs=5e-4)


def test_a_camera_that_was_zoomed_has_not_moved() -> None:
    heads = three_heads()
    before = stored(heads)
    assert before.covariance is not None
    names = (*before.names, "color.fx", "color.fy")
    before = Stored(before.sensors, names, np.diag([*np.diag(before.covariance), 0.04, 0.04]))
    color = heads["color"].camera
    heads["color"] = replace(heads["color"], camera=replace(color, fx=1.005 * color.fx, fy=1.005 * color.fy))
    found = compare(before, seen(heads, 7))
    assert named(found) == (Kind.FOCAL, ("color",))
    assert found.rivals == []
    assert found.chosen.values[0] == pytest.approx(0.005, abs=5e-4)


def test_shots_at_one_distance_cannot_tell_a_scale_from_an_offset() -> None:
    random = np.random.default_rng(0)
    heads = aligned()
    before = Stored({name: SensorState(head.camera) for name, head in heads.items()})
    heads["depth"] = replace(heads["depth"], depth_scale=0.01)
    near = look(heads, random_boards(10, random, 0.95, 1.05), random)
    found = compare(before, Views(near.corners, near.planes))
    assert {named(found), *rivals(found)} == {(Kind.SCALE, ("depth",)), (Kind.OFFSET, ("depth",)), (Kind.BOARD, ())}


def test_a_wrong_alignment_is_told_from_wrong_distances() -> None:
    heads = aligned()
    before = Stored({name: SensorState(head.camera) for name, head in heads.items()})
    heads["depth"] = replace(heads["depth"], camera=moved(heads["depth"].camera, (0.004, -0.003, 0), (0.003, 0, 0)))
    found = compare(before, seen(heads, 1, 10))
    assert named(found) == (Kind.ALIGNMENT, ("depth",))


def test_two_changes_are_no_single_one() -> None:
    heads = three_heads()
    before = stored(heads)
    for name in ("light", "color"):
        heads[name] = replace(heads[name], camera=moved(heads[name].camera, (0.003, 0, 0), (0.004, 0, 0)))
    heads["tof"] = replace(heads["tof"], depth_scale=0.02)
    found = compare(before, seen(heads, 2, 10))
    assert found.chosen.hypothesis.kind == Kind.SEVERAL


def test_shots_that_were_not_taken_at_the_same_moment_are_scatter_and_no_motion() -> None:
    random = np.random.default_rng(0)
    heads = three_heads()
    boards = random_boards(10, random)
    first = look({name: heads[name] for name in ("tof", "light")}, boards, random)
    for T_rb in boards.values():
        T_rb[:3, 3] += random.normal(0, 0.005, 3)
    late = look({"color": heads["color"]}, boards, random)
    found = compare(stored(heads), Views([*first.corners, *late.corners], first.planes))
    assert named(found) == (Kind.UNCHANGED, ())
    assert found.corners_m > 1e-3


def named(found: Comparison) -> tuple[Kind, tuple[str, ...]]:
    return found.chosen.hypothesis.kind, found.chosen.hypothesis.sensors


def rivals(found: Comparison) -> list[tuple[Kind, tuple[str, ...]]]:
    return [(each.hypothesis.kind, each.hypothesis.sensors) for each in found.rivals]


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
