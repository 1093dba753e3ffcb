"""Evidence for the scale of the stretch prior: balloons that grow, by depth alone, and draws from priors."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import abs_service as a
from abs_service.tracker.posterior.curvature import Quadratic
from abs_service.tracker.posterior.stretch_evidence import MAX_DEVIATION, StretchEvidence
from abs_service.tracker.terms.linearization import Linearization

CAMERA, SIGMA = a.Camera(160, 120, fx=150.0, fy=150.0, cx=79.5, cy=59.5), 1.5e-3
MIDDLE, RADII, WALL, FRAMES = np.array([0, 0, 0.7]), np.array([0.09, 0.1, 0.09]), 1.3, 24


def balloon(grown: float, generator: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Noisy depths [m] and mask of an ellipsoid at a flat stick before a wall, larger by a share, ray by ray."""
    x, y, _ = np.moveaxis(CAMERA.rays() / CAMERA.rays()[..., 2:], -1, 0)
    radii, far = RADII * (1 + grown), MIDDLE[2]
    square, half = (x / radii[0]) ** 2 + (y / radii[1]) ** 2 + 1 / radii[2] ** 2, far / radii[2] ** 2
    root = half**2 - square * (far**2 / radii[2] ** 2 - 1)
    ball, depth = root > 0, np.where(root > 0, (half - np.sqrt(np.maximum(root, 0))) / square, WALL)
    stick = (np.abs(x * far) < 0.05) & (y * far > 0.95 * radii[1]) & (y * far < RADII[1] + 0.14) & ~ball
    depth = np.where(stick, far, depth)
    return depth + generator.normal(0, SIGMA, depth.shape), ball | stick


def followed(growth: float, seed: int) -> np.ndarray:
    """Error and claimed σ of the balloon's vertices, medians [m], and whether it is TRACKING (frames, 3)."""
    generator, found, material = np.random.default_rng(seed), [], np.zeros(0)
    tracker = a.Tracker(CAMERA, a.Nurbs(), noise=a.noise.Constant(SIGMA))
    for k in range(FRAMES):
        share = min(k / (0.9 * FRAMES), 1.0)
        grown = growth * share**2 * (3 - 2 * share)
        depth, mask = balloon(grown, generator)
        estimate = tracker.track(depth, time_s=k / 30, mask=mask)
        assert estimate.mesh_version == 1
        material = material if k else estimate.vertices - MIDDLE
        on = np.sum((material[:, :2] / RADII[:2]) ** 2, axis=1) < 1
        error = np.linalg.norm(estimate.vertices - MIDDLE - material * (1 + grown), axis=1)
        deviation = np.sqrt(np.trace(estimate.vertex_covariance, axis1=1, axis2=2))
        found.append((np.median(error[on]), np.median(deviation[on]), estimate.status == a.Status.TRACKING))
    return np.array(found)


@pytest.mark.parametrize("seed", [2, 3, 4])
@pytest.mark.parametrize("growth", [0.15, 0.25])
def test_a_plain_balloon_that_grows_says_that_its_material_is_no_longer_known(growth, seed):
    """Its mesh keeps its size, but has to stretch a little to have the balloon's curvature. 15 frames were wrong."""
    error, deviation, is_tracking = followed(growth, seed).T
    wrong = (is_tracking > 0) & (error > np.maximum(5e-3, 3 * deviation))
    assert error[-1] > 10e-3
    assert np.count_nonzero(wrong) <= 5
    assert not wrong[-6:].any()


def test_one_that_keeps_its_size_is_as_certain_as_before():
    error, deviation, is_tracking = followed(0.0, 5).T
    assert is_tracking.all()
    assert np.all(deviation < 2e-3)
    assert np.all(error < 4e-3)


DIM, SENSED = 24, 14


@dataclass
class Linear:
    """Estimate and frame of a linear problem: measurements of some directions, a prior of them all."""

    theta: np.ndarray
    measured: np.ndarray
    root: np.ndarray
    deviation: float = 0.01

    surface = None

    def __post_init__(self):
        self.prior = self.root.T @ self.root
        self.curvature = self.measured + self.prior
        self.inverse_curvature = np.linalg.inv(self.curvature)

    @property
    def linearized(self):
        return LinearizedAt(Quadratic(np.zeros(DIM), self.curvature), self.prior)

    @property
    def stretch(self):
        return self

    motion = stretch

    def cost(self, _):
        return np.array([0.5 * self.theta @ self.prior @ self.theta])

    def linearize(self, surface, sparse_jacobian):
        assert surface is sparse_jacobian is None
        return [Linearization(self.root @ self.theta, self.root)]

    def unseen_precision(self, _):
        return 1e-6 * np.eye(DIM)


@dataclass
class LinearizedAt:
    quadratic: Quadratic
    priors: np.ndarray

    sparse_jacobian = None


def drawn(scale: float, generator: np.random.Generator) -> tuple[Linear, np.ndarray]:
    """An estimate under a prior whose deviation is that of truth over a scale, and its error (dim,)."""
    rows = generator.standard_normal((SENSED, DIM))
    root = np.linalg.qr(generator.standard_normal((DIM, DIM)))[0] * generator.uniform(0.5, 2, DIM)[:, None]
    truth = scale * np.linalg.solve(root, generator.standard_normal(DIM))
    measured = rows.T @ rows
    seen = rows.T @ (rows @ truth + generator.standard_normal(SENSED))
    theta = np.linalg.solve(measured + root.T @ root, seen)
    return Linear(theta, measured, root), theta - truth


@pytest.mark.parametrize("scale", [3.0, 8.0])
def test_errors_under_too_narrow_a_prior_are_as_large_as_claimed(scale):
    generator, squares, before, claimed = np.random.default_rng(6), [], [], []
    for _ in range(150):
        found, error = drawn(scale, generator)
        one: Any = found
        evidence, inverse = StretchEvidence(), found.inverse_curvature
        excess = [evidence.excess(one, one) for _ in range(5)][-1]
        squares.append(error @ error)
        before.append(np.trace(inverse))
        claimed.append(np.trace(inverse @ (found.curvature + excess) @ inverse))
    assert np.mean(before) < 0.2 * np.mean(squares)
    assert 0.7 < np.mean(claimed) / np.mean(squares) < 1.6


def test_a_prior_that_holds_or_is_too_wide_stays_as_it_is():
    generator, evidence = np.random.default_rng(7), StretchEvidence()
    for scale in (1.0, 0.1):
        found: list[Any] = [drawn(scale, generator)[0] for _ in range(200)]
        assert np.mean([np.any(evidence.excess(one, one)) for one in found]) < 0.05


def test_nothing_is_taken_to_stretch_more_than_rubber():
    found: Any = drawn(1e4, np.random.default_rng(8))[0]
    evidence = StretchEvidence()
    excess = [evidence.excess(found, found) for _ in range(20)][-1]
    np.testing.assert_allclose(excess, ((MAX_DEVIATION / found.deviation) ** 2 - 1) * found.prior)
    found.deviation = 2 * MAX_DEVIATION
    assert not np.any(StretchEvidence().excess(found, found))
