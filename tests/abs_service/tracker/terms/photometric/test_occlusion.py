"""Occluders that a depth sensor finds hide the mesh from sensors that measure no distances."""

import numpy as np
import pytest

from abs_service.pairing.images import ColorImage
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.synthesis.sparse import Sparse
from abs_service.tracker.terms.base import Bounds, Prediction
from abs_service.tracker.terms.photometric.color import ColorTerm
from abs_service.tracker.terms.photometric.occlusion import occluded_pixels
from calib import pose
from calib.camera import Camera
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.images.color import GaussianColor
from calib.rig import Rig, Sensor
from tests.abs_service.tracker.scenes import as_surface, depth_image, observation, sparse
from tests.abs_service.tracker.terms.depth.classification.test_visibility import MESH, STRAIGHT, board, term_before


def test_an_occluder_that_a_depth_sensor_sees_hides_colours_from_another_camera():
    camera = Camera(160, 120, 300.0, 300.0, 79.5, 59.5, T_rs=pose.from_rotation_vector([0, 0, 0], [0.05, 0, 0]))
    distance = board(STRAIGHT)
    distance[20:45, 52:77] = 0.85
    points = term_before(distance).occluders
    term = ColorTerm("color", sparse(camera, MESH), MESH.colors, GaussianColor(), Bounds(0.05, 16, 19))
    black = ColorImage(np.zeros((120, 160, 3), np.uint8))
    surface = as_surface((MESH.vertices, MESH.normals))
    uncovered = term.observe(black, Prediction(surface))
    before, cost = uncovered.fit(surface), uncovered.cost(surface)[0]
    covered = term.observe(black, Prediction(surface, occluders=points))
    after = covered.fit(surface)
    assert before.occluded == 0
    low, high = camera.project(points).min(axis=0), camera.project(points).max(axis=0)
    place = camera.project(MESH.vertices)
    inside = np.all((place > low + 0.5) & (place < high - 0.5), axis=1)
    near = np.all((place > low - 3) & (place < high + 3), axis=1)
    assert np.count_nonzero(inside) > 5
    assert np.count_nonzero(inside) <= after.occluded <= np.count_nonzero(near)
    assert covered.cost(surface)[0] == pytest.approx(
        cost - after.occluded * (19 - 0.05 - 3 * np.log(15 * np.sqrt(2 * np.pi)) - 1.5)
    )


@pytest.mark.parametrize("order", [("tof", "color"), ("color", "tof")])
def test_occluders_hide_colours_whichever_sensor_a_rig_names_first(order: tuple[str, str]):
    distance = board(STRAIGHT)
    distance[20:45, 52:77] = 0.85
    images = {"tof": depth_image(distance), "color": ColorImage(np.zeros((72, 140, 3), np.uint8))}
    noises = {"tof": GaussianPolynomial(((2e-3,),)), "color": GaussianColor()}
    rig = Rig("r", {name: Sensor(name, STRAIGHT, noises[name]) for name in order})
    objective = likelihood.Settings().build(rig, MESH, Sparse(rig, MESH))
    surface = as_surface((MESH.vertices, MESH.normals))
    fits = {fit.sensor: fit for fit in objective.observe(observation(**images), surface).fits(surface)}
    assert tuple(fits) == order
    assert fits["color"].occluded >= fits["tof"].occluded > 5  # each point covers a square


def test_points_behind_a_camera_occlude_nothing():
    points = np.array([[0.0, 0, -1], [0, 0, 0], [5, 0, 0.5]])
    assert not occluded_pixels(STRAIGHT, points).any()
