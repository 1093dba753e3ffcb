"""A box that turns shows a side that its first image did not; what touches it is no side of it."""

import numpy as np

import abs_service as a
from calib import pose

CAMERA = a.Camera(160, 120, fx=150, fy=150, cx=79.5, cy=59.5)
HALF, CENTER = np.array([0.15, 0.1, 0.1]), np.array([0.0, 0.0, 0.9])
RAYS = CAMERA.rays() / CAMERA.rays()[..., 2:]
TURN, COUNT = 20, 36


def depth(angle: float, touched: bool) -> np.ndarray:
    """Depth image [m] of a box that is turned about the x axis, before a wall; a plate may touch its upper edge."""
    turn = pose.from_rotation_vector((angle, 0.0, 0.0), (0.0, 0.0, 0.0))[:3, :3]
    origin, rays = -CENTER @ turn, RAYS @ turn
    with np.errstate(divide="ignore"):
        ends = np.stack([(side * HALF - origin) / rays for side in (-1, 1)])
    near, far = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
    z = np.where(near < far, near, 1.8)
    x, y = np.moveaxis(RAYS[..., :2] * (CENTER - HALF)[2], -1, 0)
    plate = touched & (np.abs(x) < HALF[0]) & (y < -HALF[1]) & (y > -3 * HALF[1])
    return np.where(plate, (CENTER - HALF)[2], z)


def tracked(angle: float, touches: bool) -> list[a.Estimate]:
    generator = np.random.default_rng(1)
    tracker = a.Tracker(
        depth=CAMERA,
        model=a.Rigid(),
        region={"type": "nearest"},
        noise=a.noise.Constant(0.002),
        reinitialization={"misfit_s": 0.1},
    )
    return [
        tracker.track(
            (image := depth(angle * min(k / TURN, 1), touches and k > 0))
            + generator.normal(0, 0.002, image.shape).astype(np.float32),
            time_s=k / 30,
        )
        for k in range(COUNT)
    ]


def area(estimate: a.Estimate) -> float:
    first, second, third = np.moveaxis(estimate.vertices[estimate.faces], 1, 0)
    return float(np.linalg.norm(np.cross(second - first, third - first), axis=1).sum() / 2)


def test_the_mesh_of_a_box_that_turns_gets_the_side_that_comes_into_sight():
    estimates = tracked(np.deg2rad(45), touches=False)
    assert estimates[-1].mesh_version == 2
    assert estimates[-1].status == a.Status.TRACKING
    assert area(estimates[-1]) > 1.8 * area(estimates[0])  # the largest ratio of another object's


def test_a_plate_that_touches_a_box_is_no_side_of_it():
    estimates = tracked(0.0, touches=True)
    assert {one.mesh_version for one in estimates} == {1}
    assert estimates[-1].status == a.Status.DEGRADED
    assert any("what is in sight has" in reason for one in estimates for reason in one.reasons)
