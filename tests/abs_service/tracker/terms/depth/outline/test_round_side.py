"""Sides of a surface that turn away from the sensor, told from distances: rolls and bent sheets are ray-cast."""

import numpy as np
import pytest

import abs_service as a
from abs_service.tracker.terms.depth.outline.round_side import is_round_side
from calib.camera import Camera

CAMERA = Camera(320, 240, 290.0, 290.0, 159.5, 119.5)
RADIUS_M, AT_M, WALL_M = 0.08, 0.7, 1.2


def picture(half_angle: float | np.ndarray, sigma: float = 0.001) -> tuple[np.ndarray, np.ndarray]:
    """Distances along the optical axis of a sheet bent about a vertical axis, towards the camera; pixels that show it.

    Its edges are at the angle [rad], of all rows or each (height, 1), on either side; a quarter turn and more leaves a
    roll with two silhouettes.
    """
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = rays[..., 0] / rays[..., 2], rays[..., 1] / rays[..., 2]
    square, axis = 1 + x**2, AT_M + RADIUS_M
    inside = axis**2 - square * (axis**2 - RADIUS_M**2)
    z = (axis - np.sqrt(np.maximum(inside, 0.0))) / square
    angle = np.arctan2(x * z, axis - z)
    on = (inside > 0) & (np.abs(angle) < half_angle) & (np.abs(y * z) < 0.1)
    return np.where(on, z, WALL_M) + sigma * np.random.default_rng(0).standard_normal(z.shape), on


def round_at(rows: np.ndarray, distance: np.ndarray, on: np.ndarray, away: float = 3.0) -> np.ndarray:
    """`is_round_side` of edges in some rows (k,), 3 px before the right outline, of which they are told to be away."""
    last = np.array([np.flatnonzero(on[row]).max() for row in rows], np.float64)
    places = np.stack([last - 3.0, rows.astype(np.float64)], axis=1)
    radial = (distance * np.linalg.norm(CAMERA.unproject(np.ones(on.shape)), axis=-1)).astype(np.float32)
    return is_round_side(CAMERA, radial, places, np.full(len(rows), away), np.tile([-1.0, 0.0], (len(rows), 1)))


@pytest.mark.parametrize(("half_angle", "expected"), [(np.pi / 2, True), (np.deg2rad(45), False)])
def test_a_roll_is_round_at_its_sides_and_a_bent_sheet_is_not(half_angle: float, expected: bool):
    seen, rows = picture(half_angle), np.arange(90, 150, 6)
    assert np.all(round_at(rows, *seen) == expected)
    assert not np.any(round_at(rows, *seen, away=1e9))  # nothing is known where the outline is not


def test_a_round_side_goes_on_as_far_as_the_surface_is_nearly_as_steep():
    """The edge of a sheet bent by 50° may be its end; below a roll's silhouette, it belongs to the roll.

    One that is bent by 40° does not.
    """
    rows, lower = np.arange(90, 150, 3), np.arange(CAMERA.height)[:, None] >= 105
    steep, less = (np.where(lower, np.deg2rad(angle), np.pi / 2) for angle in (50, 40))
    assert not np.any(round_at(rows, *picture(np.deg2rad(50), sigma=0)))
    assert np.all(round_at(rows, *picture(steep, sigma=0)))
    assert not np.any(round_at(rows, *picture(less, sigma=0))[rows > 125])


@pytest.mark.parametrize(("half_angle", "expected"), [(np.pi / 2, "DEGRADED"), (np.deg2rad(45), "TRACKING")])
def test_a_plain_roll_may_turn_about_its_axis_unseen(half_angle: float, expected: str):
    distance, on = picture(half_angle)
    found = a.Tracker(CAMERA, a.Nurbs()).track(distance, time_s=0, mask=on)
    assert found.status == expected
    assert ("nothing holds the surface along itself" in "".join(found.reasons)) == (expected == "DEGRADED")


@pytest.mark.parametrize(("right", "expected"), [(np.pi / 2, True), (np.deg2rad(50), False)])
def test_a_steep_side_is_round_if_the_opposite_one_is(right: float, expected: bool):
    """The left one ends at 50°; a coarse image shows a silhouette so."""
    rows, left = np.arange(90, 150, 6), picture(np.deg2rad(50), sigma=0)
    distance, on = (
        np.where(np.arange(CAMERA.width) < 160, one, two) for one, two in zip(left, picture(right, sigma=0))
    )
    first, last = np.flatnonzero(on[90])[[0, -1]]
    places = np.array([(first + 2.5, row) for row in rows] + [(last - 3.0, row) for row in rows], float)
    inwards = np.repeat([[1.0, 0.0], [-1.0, 0.0]], len(rows), axis=0)
    radial = (distance * np.linalg.norm(CAMERA.unproject(np.ones(on.shape)), axis=-1)).astype(np.float32)
    found = is_round_side(CAMERA, radial, places, np.full(len(places), 3.0), inwards)
    assert np.all(found == expected)
