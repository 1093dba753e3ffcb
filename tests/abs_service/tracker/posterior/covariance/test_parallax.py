"""Error along the surface by the parallax of the appearance on a fitted mesh."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.posterior.covariance.parallax import FittedParallax
from calib import pose
from evaluation.method.trust import SCENES
from evaluation.sequences import demo_plan, demo_rig, expose, simulate, track
from evaluation.statistics import inside_region

#: A square of 0.2 m, 1 m before a camera in the origin.
GRID = np.stack([*np.meshgrid(np.linspace(-0.1, 0.1, 5), np.linspace(-0.1, 0.1, 5)), np.ones((5, 5))], axis=-1)
POINTS = GRID.reshape(-1, 3)
CORNERS = [5 * i + j for i in range(4) for j in range(4)]
FACES = np.array([[k + a, k + b, k + c] for k in CORNERS for a, b, c in ((0, 5, 1), (1, 5, 6))], np.int32)
SIGMA = 5e-3


@dataclass
class Plane:
    """A plane that only moves along its normal, by Θ metres."""

    vertices: np.ndarray
    normal: np.ndarray

    def __post_init__(self):
        self.mesh = Mesh(self.vertices, FACES, np.zeros((25, 3), np.float32), self.vertices[:, :2])
        self.scales = np.ones(1)

    def sparse_jacobian(self, theta):
        return SparseJacobian.from_dense(np.tile(self.normal[None, :, None], (25, 1, 1)))

    def posed(self, measured=25) -> Any:
        """An estimate of this surface, and its frame."""
        parts = (self.vertices, np.tile(self.normal, (25, 1)))
        return Posed(Surface(*(np.asarray(one, np.float32).T[None] for one in parts)), measured)


@dataclass
class Posed:
    """An estimate, and a frame in which the first `measured` vertices have distances."""

    surface: Surface
    measured: int

    theta = np.zeros(1)

    def misfit(self, surface):
        return np.stack([np.zeros(25), np.where(np.arange(25) < self.measured, SIGMA, 0.0)])


def tilted(angle) -> Any:
    turn = pose.from_rotation_vector((angle, 0, 0), (0, 0, 0))[:3, :3]
    return Plane((POINTS - (0, 0, 1)) @ turn.T + (0, 0, 1), turn @ (0, 0, -1.0))


@pytest.mark.parametrize("angle", [0.0, 0.3, -0.6])
def test_it_is_what_colours_hold_on_their_lines_of_sight(angle):
    """A plane moved along its normal by one deviation of its fit; each vertex stays on its line of sight."""
    plane = tilted(angle)
    seen = plane.posed()
    found = FittedParallax(plane, [np.zeros(3)]).covariance(seen, seen)
    off = SIGMA / 5  # of a mean of 25 distances
    share = ((plane.vertices + off * plane.normal) @ plane.normal) / (plane.vertices @ plane.normal)
    beside = plane.vertices * share[:, None] - (plane.vertices + off * plane.normal)
    np.testing.assert_allclose(beside @ plane.normal, 0, atol=1e-12)
    np.testing.assert_allclose(found, beside[:, :, None] * beside[:, None, :], atol=2e-3 * off**2)


def test_it_lasts_and_turns_with_the_surface():
    plane, turn = tilted(0.4), pose.from_rotation_vector((0.1, -0.5, 0.8), (0, 0, 0))[:3, :3]
    parallax, seen = FittedParallax(plane, [np.zeros(3)]), plane.posed()
    first = parallax.covariance(seen, seen)
    turned = Plane(plane.vertices @ turn.T, turn @ plane.normal).posed(measured=0)
    np.testing.assert_allclose(parallax.covariance(turned, turned), turn @ first @ turn.T, atol=1e-9)


def test_without_distances_nothing_is_known_of_it():
    plane = tilted(0.4)
    seen = plane.posed(measured=0)
    assert not FittedParallax(plane, [np.zeros(3)]).covariance(seen, seen).any()


@pytest.mark.parametrize("seed", [22, 31])
def test_material_points_of_a_tilted_strip_are_where_the_covariance_says(seed):
    simulation = simulate(f"simulated://strip?seed={seed}")
    found = track(demo_rig(simulation), demo_plan(SCENES["strip"]), expose(simulation, range(0, 80, 2)))
    tracked = zip(found.estimates, found.material)
    inside = np.mean([inside_region(points - one.vertices, one.vertex_covariance).mean() for one, points in tracked])
    print(f"{inside:.1%} inside")
    assert inside > 0.8  # 0.2 to 0.6 without
