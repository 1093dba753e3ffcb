"""Trails of vertices: which one a click follows, how long it is kept, and when it ends."""

import numpy as np
import pytest

from abs_service.display.page.scene.fields import MeshView, ShownMesh
from abs_service.display.page.scene.trails import GAP_NS, TRAIL_NS, Trails

FRAME_NS = 33_000_000
SQUARE = np.array([[0.0, 0, 1], [0.1, 0, 1], [0, 0.1, 1], [0.1, 0.1, 1]])
FACES = np.array([[0, 1, 2], [1, 3, 2]], np.int32)


UNKNOWN = np.empty((0, 6))


def view(vertices, covariance=UNKNOWN):
    return MeshView(vertices, vertices, FACES, covariance, np.empty((0, 0)), None)


def drawn(vertices, time_ns, covariance=UNKNOWN):
    return ShownMesh(view(vertices, covariance), time_ns, None)


MESHES = {"left": view(SQUARE), "right": view(np.add(SQUARE, (1.0, 0, 0)))}


def ray_at(target):
    """Ray from the camera."""
    return np.zeros(3), target / np.linalg.norm(target)


@pytest.fixture
def trails():
    """The last vertex of the right mesh is followed."""
    made = Trails()
    assert made.follow(MESHES, ray_at(np.array([1.1, 0.1, 1.0])))
    return made


def extend(trails, times_ns, mesh="first"):
    for time_ns in times_ns:
        trails.extend("right", mesh, drawn(np.add(SQUARE, (0, 0, 1e-9 * time_ns)), time_ns), 1e-9 * time_ns)


def test_the_vertex_under_the_click_is_followed(trails):
    extend(trails, [0, FRAME_NS, 2 * FRAME_NS])
    trails.extend("left", "first", drawn(SQUARE, 0), 0.0)
    lines = trails.lines("right")
    np.testing.assert_allclose(lines[:, :, :2], np.full((2, 2, 2), 0.1))
    np.testing.assert_allclose(lines[:, :, 2] - 1, np.array([[0, 0.033], [0.033, 0.066]]), atol=1e-6)
    assert len(trails.lines("left")) == 0


@pytest.mark.parametrize("target", [(-2.0, 0, 1), (0.0, 0, -1)])
def test_a_click_beside_every_mesh_follows_nothing(target):
    trails = Trails()
    assert not trails.follow(MESHES, ray_at(np.array(target)))
    assert not trails.follow({}, ray_at(SQUARE[0]))
    extend(trails, [0, FRAME_NS])
    assert len(trails.lines("right")) == 0


def test_a_trail_is_ten_seconds_long(trails):
    extend(trails, range(0, 2 * TRAIL_NS, FRAME_NS))
    lines = trails.lines("right")
    assert 1e-9 * TRAIL_NS - 0.1 < lines[-1, 1, 2] - lines[0, 0, 2] <= 1e-9 * TRAIL_NS


def test_sigma_of_a_followed_vertex_is_kept_for_a_minute(trails):
    for second in range(90):
        covariance = np.zeros((4, 6))
        covariance[3, [0, 3, 5]] = (1e-3 * second) ** 2 / 3
        trails.extend("right", "first", drawn(SQUARE, second * 1_000_000_000, covariance), float(second))
    found = trails.sigmas("right")
    assert list(found) == ["vertex 3"]
    np.testing.assert_allclose(found["vertex 3"], np.arange(29, 90)[:, None].repeat(2, axis=1))
    assert trails.sigmas("left") == {}
    trails.forget()
    assert trails.sigmas("right") == {}


def test_nothing_is_drawn_across_a_gap(trails):
    extend(trails, [0, FRAME_NS, 2 * FRAME_NS + GAP_NS, 3 * FRAME_NS + GAP_NS])
    assert len(trails.lines("right")) == 2


def test_an_estimate_that_is_drawn_again_adds_nothing(trails):
    extend(trails, [0, FRAME_NS, FRAME_NS])
    assert len(trails.lines("right")) == 1


def test_a_jump_back_in_a_recording_begins_anew(trails):
    extend(trails, [5 * FRAME_NS, 6 * FRAME_NS, 0])
    assert len(trails.lines("right")) == 0
    extend(trails, [FRAME_NS])
    assert len(trails.lines("right")) == 1


def test_trails_end_with_their_mesh_and_when_they_are_removed(trails):
    extend(trails, [0, FRAME_NS])
    extend(trails, [2 * FRAME_NS, 3 * FRAME_NS], mesh="remade")
    assert len(trails.lines("right")) == 0
    assert trails.follow(MESHES, ray_at(np.array([1.0, 0.0, 1.0])))
    extend(trails, [4 * FRAME_NS, 5 * FRAME_NS], mesh="remade")
    assert len(trails.lines("right")) == 1
    trails.forget()
    assert len(trails.lines("right")) == 0
