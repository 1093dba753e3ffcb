"""Random vertices whose pixels single precision does not decide otherwise, and settings of tests with them."""

import os

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from calib.camera import Camera
from tests import reference
from tests.abs_service.tracker.scenes import (
    CAMERA,
)

INTERPRETED = os.environ.get("NUMBA_DISABLE_JIT", "0") != "0"


few = settings(max_examples=10 if INTERPRETED else 50)


seeds = st.integers(0, 2**32 - 1)


def scattered(generator: np.random.Generator, count: int, width: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices in and around the camera's view, some behind it, with normals in all directions."""
    vertices = generator.uniform((-0.5 * width, -0.4 * width, 0.4), (0.5 * width, 0.4 * width, 1.6), (count, 3))
    vertices[::7, 2] -= 2
    normals = generator.normal(size=(count, 3)) - (0, 0, 1)
    return vertices.astype(np.float32), (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)


def undecided(camera: Camera, vertices: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Vertices (n,) so near to a pixel's rim, or so nearly edge-on, that single precision may decide otherwise."""
    place = np.array([reference.project(camera, vertex) for vertex in vertices.astype(float)])
    rim = np.abs(place + 0.5 - np.round(place + 0.5)).min(axis=1) < 1e-3
    edge_on = np.abs(np.einsum("ni,ni->n", normals, vertices - camera.center)) < 1e-5
    return rim | edge_on


def decided(generator: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    vertices, normals = scattered(generator, count)
    keep = ~undecided(CAMERA, vertices, normals)
    return vertices[keep], normals[keep]
