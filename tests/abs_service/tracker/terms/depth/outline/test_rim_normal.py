"""Edges tell where they are across the outline, and nothing of where they are along it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import abs_service as a
from abs_service.tracker.models.base import Surface
from abs_service.tracker.terms.depth.outline.rim_classes import MIN_COSINE, turns_away
from abs_service.tracker.terms.depth.outline.rim_motion import by_side
from abs_service.tracker.terms.depth.outline.rim_normal import EDGES, FACING, MIN_EDGES, across_rim, rim_directions
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
    long = np.abs(directions @ along) < 0.1
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
    np.testing.assert_allclose(across_rim(-directions, rim_directions(places, directions)), -directions, atol=1e-9)
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


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_the_directions_match_numpy(seed: int, count: int):
    """Edges on pixels, so that some are as far away as others; some places are unknown."""
    generator = np.random.default_rng(seed)
    places, angles = generator.integers(0, 30, (count, 2)).astype(np.float64), generator.uniform(0, 6, count)
    places += 1e-3 * generator.standard_normal(places.shape)
    places[generator.random(count) < 0.05] = np.nan
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    expected = np.zeros_like(places)
    for k in range(count):
        apart = np.linalg.norm(places - places[k], axis=1)
        alike = np.flatnonzero((directions @ directions[k] >= FACING) & np.isfinite(apart))
        around = places[alike[np.argsort(apart[alike])[:EDGES]]]
        if len(around) >= MIN_EDGES:
            expected[k] = np.linalg.eigh(np.cov(around.T))[1][:, 1]
    found = rim_directions(places, directions)
    np.testing.assert_allclose(np.abs(np.vecdot(found, expected)), np.vecdot(expected, expected), atol=1e-6)
    np.testing.assert_allclose(np.vecdot(found, found), np.vecdot(expected, expected), atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(0, 40))
def test_edges_face_the_nearest_side_of_the_image(seed: int, count: int):
    directions = np.random.default_rng(seed).standard_normal((count, 2))
    right, down = directions.T
    expected = [right > abs(down), down > abs(right), -right > abs(down), -down > abs(right)]
    np.testing.assert_array_equal(by_side(directions), np.reshape(expected, (4, count)))


@given(st.integers(0, 2**32 - 1))
def test_a_surface_turns_away_at_its_rim_as_the_cosines_there_and_inside_say(seed: int):
    generator, camera = np.random.default_rng(seed), a.Camera(WIDTH, HEIGHT, fx=270, fy=270, cx=159.5, cy=119.5)
    vertices = generator.uniform((-1, -1, 1), (1, 1, 3), (30, 3))
    normals = generator.standard_normal((30, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    surface = Surface(*(np.ascontiguousarray(part.T[None], np.float32) for part in (vertices, normals)))
    outer, inner = np.arange(15), np.arange(15, 30)
    cosine = np.abs(np.vecdot(normals, vertices)) / np.linalg.norm(vertices, axis=1)
    beyond = 2 * cosine[outer] - cosine[inner]
    sure = np.abs(beyond - MIN_COSINE) > 1e-5
    np.testing.assert_array_equal(turns_away(camera, surface, outer, inner)[sure], (beyond < MIN_COSINE)[sure])
