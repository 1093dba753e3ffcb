"""A printed object that was lost keeps its mesh, and its vertices their material points, however it comes back."""

import cv2
import numpy as np

import abs_service as a
from tests.abs_service.api.scenes import NOISE, Sheet

#: Their centres are in the middle: a turned image is that of a scene which has turned around the optical axis.
DEPTH = a.Camera(160, 120, fx=200, fy=200, cx=79.5, cy=59.5)
COLOR = a.Camera(320, 240, fx=400, fy=400, cx=159.5, cy=119.5)

SHEET = Sheet(curvature=0.8)


def printed() -> np.ndarray:
    """The colour image of the sheet with a print of irregular blobs, by the material coordinates of its pixels."""
    noise = np.random.default_rng(5).normal(size=(400, 560)).astype(np.float32)
    blobs = cv2.GaussianBlur(noise, (0, 0), 6)
    along, across = np.moveaxis(SHEET.seen(COLOR)[1], -1, 0).astype(np.float32)
    column, row = (along / SHEET.width + 0.5) * 559, (across / SHEET.height + 0.5) * 399
    grey = 128 + 60 * cv2.remap(blobs / blobs.std(), column, row, cv2.INTER_LINEAR)
    return np.repeat(np.where(np.isfinite(along), np.clip(grey, 0, 255), 20).astype(np.uint8)[..., None], 3, axis=2)


def wall(seed: int) -> np.ndarray:
    return 1.2 + np.random.default_rng(seed).normal(0, 0.001, (DEPTH.height, DEPTH.width))


def turned(image: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(image[::-1, ::-1])


def test_a_print_that_comes_back_upside_down_is_recognised():
    tracker = a.Tracker(depth=DEPTH, noise=NOISE, color=COLOR, model=a.Nurbs())
    image, nothing = printed(), np.full((COLOR.height, COLOR.width, 3), 20, np.uint8)
    seen = [(SHEET.depth(DEPTH, k), image) for k in range(6)]
    gone = [(wall(k), nothing) for k in range(8)]
    back = [(turned(SHEET.depth(DEPTH, k)), turned(image)) for k in range(20, 32)]
    estimates = [
        tracker.track(depth, time_s=k / 30, image=picture) for k, (depth, picture) in enumerate(seen + gone + back)
    ]
    before, last = estimates[5], estimates[-1]
    assert (before.status, last.status) == (a.Status.TRACKING, a.Status.TRACKING)
    assert last.mesh_version == before.mesh_version
    away = np.linalg.norm(last.vertices - before.vertices * (-1, -1, 1), axis=1)
    assert np.median(away) < 0.003
