"""An outline is found beside the mesh, so that a plain board may move fast."""

import numpy as np
import pytest

import abs_service as a
from abs_service.tracker.terms.depth.outline.rim_match import shift_to_outline
from tests.abs_service.tracker.terms.depth.outline.pixelated import (
    HEIGHT,
    WIDTH,
    edges,
    inside_of,
    reading,
    rectangle,
    turned,
)


@pytest.mark.parametrize("by", [(9.0, -5.0), (-14.0, 2.0), (3.0, 12.0)])
def test_edges_are_laid_on_an_outline_that_has_moved_and_turned(by: tuple[float, float]):
    corners, angle = rectangle(150.0, 90.0), 0.06
    places, directions = edges(corners)
    look = reading(inside_of(turned(corners, angle, by)))
    shift = shift_to_outline(look, places, directions)
    np.testing.assert_allclose(shift, turned(places, angle, by) - places, atol=1.0)


def test_along_two_parallel_edges_nothing_is_moved():
    corners = rectangle(300.0, 90.0)
    places, directions = edges(corners)
    long = np.abs(directions[:, 1]) > np.abs(directions[:, 0])
    look = reading(inside_of(turned(corners, 0.0, (9.0, 6.0))))
    shift = shift_to_outline(look, places[long], directions[long])
    np.testing.assert_allclose(shift[:, 1], 6.0, atol=0.5)
    np.testing.assert_allclose(shift[:, 0], 0.0, atol=0.5)


def test_nothing_is_moved_to_another_outline():
    places, directions = edges(rectangle(150.0, 90.0))
    smaller = reading(inside_of(rectangle(60.0, 40.0)))
    assert not shift_to_outline(smaller, places, directions).any()
    assert not shift_to_outline(reading(np.full((HEIGHT, WIDTH), np.nan, np.float32)), places, directions).any()
    assert not shift_to_outline(smaller, places[:5], directions[:5]).any()


def test_a_plain_board_that_moves_off_at_once_is_followed():
    camera = a.Camera(WIDTH, HEIGHT, fx=270, fy=270, cx=159.5, cy=119.5)
    rays = camera.rays()
    x, y = rays[..., 0] / rays[..., 2] * 0.8, rays[..., 1] / rays[..., 2] * 0.8
    tracker = a.Tracker(camera, a.Nurbs(), noise=a.noise.Constant(0.002), vertices=200)
    generator, moved = np.random.default_rng(3), 0.0
    for frame in range(14):
        moved = 0.13 * np.sin(2 * np.pi * frame / 28)  # 29 mm or 10 px in a frame
        on = (np.abs(x - moved) < 0.2) & (np.abs(y + 0.1 * (x - moved)) < 0.13)
        depth = np.where(on, 0.8, 1.4) + 0.001 * generator.standard_normal(on.shape)
        found = tracker.track(depth, time_s=1 + frame / 30)
        error = np.abs(found.vertices[:, 0] - found.undeformed[:, 0] - moved)
        assert found.status == "TRACKING", found.reasons
        assert np.median(error) < 0.005
