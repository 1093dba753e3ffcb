"""The slide along the surface that the first estimate shows stays in the covariance of the vertices."""

import numpy as np

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.posterior.covariance.first_frame_slide import FirstFrameSlide
from calib import pose
from evaluation.method.trust import SCENES
from evaluation.sequences import demo_plan, demo_rig, expose, simulate, track
from evaluation.statistics import inside_region

#: A fan of triangles that faces the camera.
POINTS = np.array([[0, 0, 1], [0.1, 0, 1], [0.05, 0.1, 1], [-0.05, 0.1, 1], [-0.1, 0, 1]], np.float64)
FAN = Mesh(POINTS, np.array([[0, 2, 1], [0, 3, 2], [0, 4, 3]], np.int32), np.zeros((5, 3), np.float32), POINTS[:, :2])
FACING = np.tile([0.0, 0.0, -1.0], (5, 1))
SLIDE = np.array([3e-4, -4e-4, 2e-3])

#: 1e-4 m in every direction.
KNOWN = np.tile(1e-8 * np.eye(3), (5, 1, 1))


def surface(vertices, normals=FACING):
    """A population of one, from vertices and normals (n, 3)."""
    return Surface(*(np.asarray(one, np.float32).T[None] for one in (vertices, normals)))


def test_a_slide_is_an_error_in_its_direction_along_the_surface():
    found = FirstFrameSlide(FAN).beyond(surface(POINTS + SLIDE), KNOWN)
    expected = np.outer([3e-4, -4e-4, 0], [3e-4, -4e-4, 0])
    np.testing.assert_allclose(found, np.tile(expected, (5, 1, 1)), atol=1e-11)


def test_a_slide_that_noise_explains_is_none():
    found = FirstFrameSlide(FAN).beyond(surface(POINTS + SLIDE), 9 * KNOWN)
    assert not found.any()


def test_it_lasts_and_turns_with_the_object():
    slide, turn = FirstFrameSlide(FAN), pose.from_rotation_vector((0.5, 0.2, 0.7), (0, 0, 0))[:3, :3]
    first = slide.beyond(surface(POINTS + SLIDE), KNOWN)
    later = slide.beyond(surface(POINTS @ turn.T + 0.3, FACING @ turn.T), KNOWN)
    np.testing.assert_allclose(later, turn @ first @ turn.T, atol=1e-11)


def test_material_points_of_a_board_with_sharp_print_are_where_the_covariance_says():
    simulation = simulate("simulated://board?seed=31")
    found = track(demo_rig(simulation), demo_plan(SCENES["board"]), expose(simulation, range(0, 80, 2)))
    tracked = zip(found.estimates, found.material)
    inside = np.mean([inside_region(points - one.vertices, one.vertex_covariance).mean() for one, points in tracked])
    print(f"{inside:.1%} inside")
    assert inside > 0.8
