"""Planes of a sensor that measured distances only, from which its first pose comes."""

import numpy as np
import pytest

from calib import pose
from calib.board.views import PlaneView
from calib.camera import Camera
from calib.solve.start.extrinsics_graph import NotConnectedError
from calib.solve.start.registration import fit_plane, register


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


def test_distances_in_another_unit_are_named() -> None:
    camera, random = Camera(320, 240, 280, 280, 159.5, 119.5), np.random.default_rng(0)
    pixels = np.stack([grid.ravel() for grid in np.mgrid[110:210:5.0, 80:160:5.0]], axis=1)
    boards = {
        shot: pose.from_rotation_vector(random.uniform(-0.5, 0.5, 3), np.array([0, 0, random.uniform(0.6, 1.3)]))
        for shot in range(10)
    }

    def views(unit: float) -> list[PlaneView]:
        found = []
        for shot, board in boards.items():
            n, t = board[:3, 2], board[:3, 3]
            distances = unit * (n @ t / (camera.directions(pixels) @ n) + random.normal(0, 0.003, len(pixels)))
            found.append(PlaneView("tof", shot, 0.0, pixels, distances, np.full(len(pixels), 0.003)))
        return found

    np.testing.assert_allclose(register("tof", camera, views(1.03), boards), np.eye(4), atol=0.05)
    with pytest.raises(NotConnectedError, match=r"tof: its distances are 0\.1 times as long as those of the boards"):
        register("tof", camera, views(0.1), boards)
