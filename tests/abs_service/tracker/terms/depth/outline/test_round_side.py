"""Sides of a surface that turn away from the sensor, told from distances: rolls and bent sheets are ray-cast."""

import numpy as np
import pytest

import abs_service as a
from abs_service.tracker.terms.depth.outline.round_side import is_round_side
from calib.camera import Camera

CAMERA = Camera(320, 240, 290.0, 290.0, 159.5, 119.5)
RADIUS_M, AT_M, WALL_M = 0.08, 0.7, 1.2


def picture(half_angle: float, sigma: float = 0.001) -> tuple[np.ndarray, np.ndarray]:
    """Distances along the optical axis of a sheet bent about a vertical axis, towards the camera; pixels that show it.

    Its edges are at the angle [rad] on either side; a quarter turn and more leaves a roll with two silhouettes.
    """
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = rays[..., 0] / rays[..., 2], rays[..., 1] / rays[..., 2]
    square, axis = 1 + x**2, AT_M + RADIUS_M
    inside = axis**2 - square * (axis**2 - RADIUS_M**2)
    z = (axis - np.sqrt(np.maximum(inside, 0.0))) / square
    angle = np.arctan2(x * z, axis - z)
    on = (inside > 0) & (np.abs(angle) < half_angle) & (np.abs(y * z) < 0.1)
    return np.where(on, z, WALL_M) + sigma * np.random.default_rng(0).standard_normal(z.shape), on


@pytest.mark.parametrize(("half_angle", "expected"), [(np.pi / 2, True), (np.deg2rad(45), False)])
def test_a_roll_is_round_at_its_sides_and_a_bent_sheet_is_not(half_angle: float, expected: bool):
    distance, on = picture(half_angle)
    rows = np.arange(90, 150, 6)
    last = np.array([np.flatnonzero(on[row]).max() for row in rows], np.float64)
    places = np.stack([last - 3.0, rows.astype(np.float64)], axis=1)
    inwards = np.tile([-1.0, 0.0], (len(rows), 1))
    radial = (distance * np.linalg.norm(CAMERA.unproject(np.ones(on.shape)), axis=-1)).astype(np.float32)
    found = is_round_side(CAMERA, radial, places, np.full(len(rows), 3.0), inwards)
    assert np.all(found == expected)
    away = is_round_side(CAMERA, radial, places, np.full(len(rows), 1e9), inwards)
    assert not np.any(away)  # nothing is known where the outline is not


@pytest.mark.parametrize(("half_angle", "expected"), [(np.pi / 2, "DEGRADED"), (np.deg2rad(45), "TRACKING")])
def test_a_plain_roll_may_turn_about_its_axis_unseen(half_angle: float, expected: str):
    distance, on = picture(half_angle)
    found = a.Tracker(CAMERA, a.Nurbs()).track(distance, time_s=0, mask=on)
    assert found.status == expected
    assert ("nothing holds the surface along itself" in "".join(found.reasons)) == (expected == "DEGRADED")
