"""Edges tell where they are across the outline, and nothing of where they are along it."""

import numpy as np
import pytest

import abs_service as a
from abs_service.tracker.terms.depth.outline.rim_normal import across_rim, rim_directions
from tests.abs_service.tracker.terms.depth.outline.pixelated import (
    HEIGHT,
    WIDTH,
    edges,
    inside_of,
    reading,
    rectangle,
    turned,
)


@pytest.mark.parametrize("angle", [0.05, 0.12, 0.3])
def test_two_long_edges_do_not_hold_a_board_along_itself(angle: float):
    corners = turned(rectangle(260.0, 90.0), angle)
    places, directions = edges(corners)
    along = (corners[1] - corners[0]) / np.linalg.norm(corners[1] - corners[0])
    long = np.abs(directions @ along) < 0.1 * np.linalg.norm(directions, axis=1)
    # As long as the raster lasts, the mesh lies a little beside the outline.
    gradients = reading(inside_of(corners))(places + 1.5 * along[::-1] * (1, -1))[1]
    across = across_rim(gradients, rim_directions(places, directions))
    of_pixels, of_rim = (np.sum((rows[long] @ along) ** 2) for rows in (gradients, across))
    assert of_rim < 0.02
    assert of_pixels > 5 * of_rim
    assert np.median(np.abs(across @ (along[::-1] * (-1, 1)))[long]) > 0.9


def test_corners_and_lonely_edges_keep_their_direction():
    corners = rectangle(120.0, 90.0)
    places, directions = edges(corners)
    outwards = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(across_rim(-outwards, rim_directions(places, directions)), -outwards, atol=1e-9)
    assert not rim_directions(places[:2], directions[:2]).any()


def test_a_board_whose_ends_are_out_of_the_image_is_held_by_nothing():
    camera = a.Camera(WIDTH, HEIGHT, fx=270, fy=270, cx=159.5, cy=119.5)
    rays = camera.rays()
    x, y = rays[..., 0] / rays[..., 2] * 0.8, rays[..., 1] / rays[..., 2] * 0.8
    tracker = a.Tracker(camera, a.Nurbs(), noise=a.noise.Constant(0.002), vertices=300)
    generator = np.random.default_rng(5)
    on = np.abs(y - 0.08 * x) < 0.13
    found = tracker.track(np.where(on, 0.8, 1.4), time_s=1)
    for frame in range(1, 4):
        found = tracker.track(
            np.where(on, 0.8, 1.4) + 0.002 * generator.standard_normal(on.shape), time_s=1 + frame / 30
        )
    assert found.status == "DEGRADED"
    assert "nothing holds the surface along itself" in "".join(found.reasons)
