"""Extrapolated edges begin on the outline, however far the mesh ends inside the object."""

import numpy as np
import pytest

from abs_service.tracker.terms.depth.outline.rim_gap import exact_gap
from calib.camera import Camera
from tests.abs_service.tracker.terms.depth.outline.pixelated import (
    HEIGHT,
    WIDTH,
    edges,
    inside_of,
    reading,
    rectangle,
    turned,
)

CAMERA = Camera(WIDTH, HEIGHT, 300.0, 300.0, WIDTH / 2 - 0.5, HEIGHT / 2 - 0.5)


@pytest.mark.parametrize("angle", [0.0, 0.15, 0.4])
def test_edges_end_on_the_outline_where_one_step_along_the_gradient_misses_it(angle: float):
    corners = turned(rectangle(180.0, 120.0), angle)
    look = reading(inside_of(corners))
    on, outwards = edges(corners, 11.0)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    lean = np.where(np.arange(len(on)) % 2, 0.5, -0.5)[:, None]  # as in a hexagonal grid
    step_px = 12 * (outwards + lean * outwards[:, ::-1] * (1, -1))
    outer = at(on - 0.8 * step_px)
    step = at(on + 0.2 * step_px) - outer
    inside, gradients = look(CAMERA.project(outer))
    guess = np.clip(inside / np.maximum(-np.vecdot(gradients, step_px), 1e-9), 0.0, 2.0)
    found = exact_gap(CAMERA, outer, step, guess, look)
    middle = np.linalg.norm((on[:, None] - corners)[:, :], axis=2).min(axis=1) > 20
    at_first, at_last = (np.abs(look(CAMERA.project(outer + gap[:, None] * step))[0])[middle] for gap in (guess, found))
    assert at_last.max() < 0.2
    assert at_first.max() > 3 * at_last.max() or angle == 0.0


def test_a_guess_is_kept_where_no_outline_is_near():
    empty = reading(np.full((HEIGHT, WIDTH), 100.0, np.float32))
    outer, step = at(np.array([[100.0, 100.0]])), np.array([[0.01, 0.0, 0.0]])
    np.testing.assert_allclose(exact_gap(CAMERA, outer, step, np.array([0.7]), empty), 0.7, rtol=1e-6)


def at(places: np.ndarray) -> np.ndarray:
    """Points (k, 3) [m] on a plane at 1 m that are seen at places (k, 2) [px]."""
    center = np.array([CAMERA.cx, CAMERA.cy])
    return np.concatenate([(places - center) / CAMERA.fx, np.ones((len(places), 1))], axis=1)
