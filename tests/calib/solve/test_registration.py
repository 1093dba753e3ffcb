"""Planes of a sensor that measured distances only, from which its first pose comes."""

import numpy as np

from calib.board.views import PlaneView
from calib.camera import Camera
from calib.solve.start.registration import fit_plane


def test_flying_pixels_do_not_turn_a_plane() -> None:
    camera, random = Camera(320, 240, 280, 280, 159.5, 119.5), np.random.default_rng(0)
    pixels = np.stack([grid.ravel() for grid in np.mgrid[110:210:3.0, 80:160:3.0]], axis=1)
    normal = np.array([0.5, 0.0, np.sqrt(0.75)])
    distances = 0.8 / (camera.directions(pixels) @ normal) + random.normal(0, 0.002, len(pixels))
    flying = random.random(len(pixels)) < 0.05
    distances[flying] = random.uniform(0.3, 3, flying.sum())
    view = PlaneView("tof", 0, 0.0, pixels, distances, np.full(len(pixels), 0.002))
    found, height = fit_plane(camera, view)
    assert np.degrees(np.arccos(found @ normal)) < 0.3
    assert abs(height - 0.8) < 0.002
