"""Vertex offsets follow a Kalman filter per vertex and reduce the surface error of a simulated sheet."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.images import DepthImage
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracking.vertex_offsets import FilteredOffsets, FixedOffsets, Settings
from calib.camera import Camera
from calib.noise.constant import Constant
from calib.rig import Sensor

CAMERA = Camera(32, 24, 30.0, 30.0, 15.5, 11.5)
SIGMA = 2e-3


class Flat:
    """Vertices in pixel centres, all at one distance along their sights, with offsets."""

    def __init__(self, deviation: float):
        rows, columns = np.mgrid[4:20:4, 4:28:4].reshape(2, -1)
        self.sight = CAMERA.directions(np.stack([columns, rows], axis=-1).astype(float))
        self.pixels = rows, columns
        n = len(rows)
        empty = np.zeros((0, 3), np.int32)
        self.mesh = Mesh(self.sight, empty, np.zeros((n, 3), np.float32), np.zeros((n, 2)), {}, np.full(n, deviation))
        self.offset = np.zeros(n)

    def add_offsets(self, by: np.ndarray) -> None:
        self.offset += by

    @property
    def surface(self) -> Surface:
        """The normals look back along the sights, so that an offset is a distance."""
        vertices = self.sight * (1 - self.offset)[:, None]
        return Surface(*(np.ascontiguousarray(part.T[None], np.float32) for part in (vertices, -self.sight)))

    def image(self, distances: np.ndarray) -> DepthImage:
        distance = np.full((24, 32), np.nan, np.float32)
        distance[self.pixels] = distances
        return DepthImage(distance, np.full_like(distance, np.nan))


def filtered(model: Flat, random_walk: float) -> FilteredOffsets:
    noise = Constant(SIGMA)
    return FilteredOffsets(model, Sensor("depth", CAMERA, noise), noise, random_walk)


@settings(max_examples=20)
@given(st.floats(1e-4, 5e-3), st.floats(1e-4, 1e-2), st.integers(0, 2**32))
def test_each_offset_follows_its_own_kalman_filter(deviation, random_walk, seed):
    model, generator = Flat(deviation), np.random.default_rng(seed)
    offsets = filtered(model, random_walk)
    offset, variance = np.zeros(len(model.offset)), np.full(len(model.offset), deviation**2)
    for k in range(5):
        measured = 1 - 1e-3 * generator.standard_normal(len(offset))
        measured[k] = np.nan  # no return, no update
        offsets.update(model.image(measured), model.surface, k * 50_000_000)
        variance += random_walk**2 * (1 / 30 if k == 0 else 0.05)
        gain = np.where(np.isnan(measured), 0, variance / (variance + SIGMA**2))
        innovation = np.nan_to_num((1 - measured) - offset)
        gain[innovation**2 > 9 * (variance + SIGMA**2)] = 0
        offset, variance = offset + gain * innovation, (1 - gain) * variance
    np.testing.assert_allclose(model.offset, offset, atol=2e-6)
    np.testing.assert_allclose(offsets.variance, variance, rtol=1e-6)


def test_outliers_and_missing_images_leave_the_offsets_unchanged():
    model = Flat(1e-3)
    offsets = filtered(model, 1e-3)
    offsets.update(model.image(np.full(len(model.offset), 0.9)), model.surface, 0)
    offsets.update(None, model.surface, 1)
    assert not model.offset.any()


def test_without_random_walk_or_model_offsets_the_offsets_are_fixed():
    model, sensor = Flat(1e-3), Sensor("depth", CAMERA, Constant(SIGMA))
    assert isinstance(Settings().build(model, sensor), FixedOffsets)
    assert isinstance(Settings(1e-3).build(object(), sensor), FixedOffsets)
    assert isinstance(Settings(1e-3).build(model, sensor), FilteredOffsets)


@pytest.mark.slow
def test_filtered_offsets_reduce_the_surface_error_of_a_simulated_sheet():
    from abs_service.tracking.session import TrackingSession
    from tests.tracker.driving import default_plan, drive, mean_errors, rig_of, simulate

    simulation = simulate("simulated://sheet?seed=1")
    fixed, adaptive = (
        mean_errors(
            list(
                drive(
                    TrackingSession(rig_of(simulation), replace(default_plan(), vertex_offsets=offsets)),
                    simulation,
                    range(90),
                )
            )[30:]
        )
        for offsets in (Settings(), Settings(1e-4))
    )
    assert adaptive[1] < 0.85 * fixed[1]
