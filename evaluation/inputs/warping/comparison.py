"""Input warping (section 3.2) against OpenCV's depth registration: coverage, accuracy and time.

A slanted plane, a ball and a board before a wall, seen by a depth camera of 640 × 576 pixels with a noise of 1 mm and
warped into a colour camera of 1280 × 720; the truth is cast along the colour camera's rays, and fill and error are
those where the depth camera sees the same. Milliseconds are the least of many, those of OpenCV without the conversions
from and to radial distances.
"""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from calib.warp.mesh import MeshWarp
from evaluation.inputs.warping.splat import SplatWarp
from evaluation.scenes.solids import Ball, Plane, Solid, image, seen_by

SOURCE = Camera(640, 576, 504.0, 504.2, 320.4, 326.1)
TARGET = Camera(
    1280, 720, 605.1, 605.0, 638.6, 367.2, T_rs=pose.from_rotation_vector([-0.1, 0.01, 0.0], [0.032, 0.002, -0.004])
)
NOISE_M = 1e-3
_WALL = Plane(np.array([-0.3, 0.2, 1.0]), 1.4)
SCENES: dict[str, tuple[Solid, ...]] = {
    "slanted plane": (Plane(np.array([-0.5, 0.25, 1.0]), 1.2),),
    "ball before a wall": (Ball(np.array([0.1, 0.0, 1.1]), 0.3), _WALL),
    "board before a wall": (Plane(np.array([0.1, 0.05, 1.0]), 0.8, (-0.2, 0.25, -0.15, 0.2)), _WALL),
}
ROUNDS = 40

Method = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True)
class Row:
    """Figures of a method on a scene: share of what the source sees that has a distance [%], error [mm], time [ms]."""

    scene: str
    method: str
    fill: float
    bias_mm: float
    p95_mm: float
    time_ms: float


def methods(source: Camera, target: Camera, pool: ThreadPoolExecutor) -> dict[str, Method]:
    """Every method, from radial distances to radial distances [m]; NaN where there is none."""
    meshes = {
        "mesh": MeshWarp(source, target),
        "mesh, 2 threads": MeshWarp(source, target, each=pool.map, parts=2),
        "splat": SplatWarp(source, target),
    }
    ours: dict[str, Method] = {name: lambda d, warp=warp: warp.warp(d).distance for name, warp in meshes.items()}
    return ours | {
        "cv2.registerDepth": _register(source, target, dilate=False),
        "cv2.registerDepth, dilated": _register(source, target, dilate=True),
    }


def _register(source: Camera, target: Camera, *, dilate: bool) -> Method:
    """OpenCV's registration, from and to radial distances; the conversions are not part of its time."""
    register = _register_z(source, target, dilate=dilate)
    to_z, per_z = 1 / source.lookup.ray_length, target.lookup.ray_length

    def convert(distance: NDArray[np.float64]) -> NDArray[np.float64]:
        registered = register(np.nan_to_num(distance * to_z).astype(np.float32))
        return np.where(registered > 0, registered * per_z, np.nan)

    return convert


def _register_z(
    source: Camera, target: Camera, *, dilate: bool
) -> Callable[[NDArray[np.float32]], NDArray[np.float32]]:
    """OpenCV's registration of images of z [m], 0 where there is none; it ignores distortion of the source."""
    K, L = (np.array([[c.fx, 0, c.cx], [0, c.fy, c.cy], [0, 0, 1]]) for c in (source, target))
    T_ts, lens, size = target.T_sr @ source.T_rs, target.lens.coefficients, (target.width, target.height)

    def register(z: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.asarray(cv2.registerDepth(K, L, lens, T_ts, z, size, depthDilation=dilate), np.float32)

    return register


def opencv_alone_ms(
    source: Camera, target: Camera, distance: NDArray[np.float64], *, dilate: bool, rounds: int = ROUNDS
) -> float:
    """Time of `cv2.registerDepth` without conversions [ms]."""
    register = _register_z(source, target, dilate=dilate)
    z = np.nan_to_num(distance / source.lookup.ray_length).astype(np.float32)
    return fastest_ms(lambda: register(z), rounds)


def fastest_ms(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Shortest time of many repetitions [ms]."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter_ns()
        work()
        times.append(time.perf_counter_ns() - start)
    return min(times) * 1e-6


def simulated(scenes: Sequence[str], seeds: Sequence[int], rounds: int, pool: ThreadPoolExecutor) -> list[Row]:
    """All methods on some scenes; time is the least of so many rounds."""
    rows = []
    for scene in scenes:
        solids = SCENES[scene]
        clean, truth = (image(camera, solids) for camera in (SOURCE, TARGET))
        visible = seen_by(SOURCE, TARGET.unproject(truth), solids)[1]
        for name, method in methods(SOURCE, TARGET, pool).items():
            errors, filled = [], []
            for seed in seeds:
                noise = np.random.default_rng(seed).normal(0, NOISE_M, clean.shape)
                found = method(clean + noise)
                known = np.isfinite(found) & visible
                errors.append((found - truth)[known])
                filled.append(np.count_nonzero(known) / np.count_nonzero(visible))
            error = np.concatenate(errors) * 1e3
            if name.startswith("cv2"):
                time_ms = opencv_alone_ms(SOURCE, TARGET, clean, dilate="dilated" in name, rounds=rounds)
            else:
                time_ms = fastest_ms(lambda method=method, clean=clean: method(clean), rounds)
            p95 = float(np.quantile(np.abs(error), 0.95))
            rows.append(Row(scene, name, 100 * float(np.mean(filled)), float(error.mean()), p95, time_ms))
    return rows
