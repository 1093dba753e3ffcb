"""Vertex offsets are learnt from depth images, as a surface, and reduce the surface error of a simulated sheet."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.tracking.offsets import vertex_offsets
from abs_service.tracking.offsets.heights import Heights, HeightSensor
from abs_service.tracking.offsets.offset_field import change_prior, offset_prior
from abs_service.tracking.offsets.vertex_offsets import FixedOffsets, LearntOffsets, Settings, folded
from tests.abs_service.tracking.offsets.offset_sheet import (
    CAMERA,
    COLUMNS,
    NOISE,
    ROWS,
    SENSOR,
    SIGMA,
    Flat,
    flat_mesh,
    image,
    offset_z,
)
from tests.abs_service.tracking.offsets.test_offset_field import dense

N = ROWS * COLUMNS
FRAME_NS = 33_333_333
SHAPE = (CAMERA.height, CAMERA.width)


def learnt(model: Flat, random_walk: float = 0.0) -> LearntOffsets:
    offsets = LearntOffsets(model, SENSOR, NOISE, random_walk)
    offsets.update(None, model.surface, 0)
    return offsets


def missed(heights: Heights, variance: np.ndarray) -> np.ndarray:
    """Vertices around which the heights, added up, are farther off than three deviations of their noise."""
    noise = [1 / own + other if own else 0.0 for own, other in zip(heights.precision, variance)]
    around = [{v, *flat_mesh().edges[(flat_mesh().edges == v).any(axis=1)].ravel().tolist()} for v in range(N)]
    sums = [(sum(heights.mean[k] for k in ring), sum(noise[k] for k in ring)) for ring in around]
    return np.array([abs(total) > 3 * np.sqrt(square) for total, square in sums])


@settings(max_examples=10, deadline=None)
@given(st.sampled_from([0.0, 1e-4, 1.6e-3]), st.floats(1e-3, 4e-3), st.integers(0, 2**32))
def test_updates_are_those_of_the_dense_equations(random_walk, size, seed):
    generator = np.random.default_rng(seed)
    true_offsets = size * np.sin(flat_mesh().chart[:, 0])
    first = true_offsets + 1e-3 * generator.standard_normal(N)
    model = Flat(first)
    offsets, sensor = learnt(model, random_walk), HeightSensor(CAMERA, NOISE, model.mesh)
    mean, precision = first, np.full(N, 1e6)
    prior = offset_prior(first, np.full(N, 1e-3), model.mesh, 0)
    matrix = dense(precision, prior)
    offset = np.linalg.solve(matrix, precision * mean)
    if random_walk:
        change = offsets.variance + random_walk**2 * 2.5
        prior = change_prior(offset, change, 0.2 * np.median(vertex_offsets.edges_around(model.mesh)))
    for k in range(1, 6):
        np.testing.assert_allclose(model.offset, offset, atol=3e-6)
        picture = image(offset_z(true_offsets) + SIGMA * generator.standard_normal(SHAPE))
        vertices, normals = (part[0].T.astype(float) for part in (model.surface.vertices, model.surface.normals))
        precision = precision / (1 + precision * random_walk**2 * FRAME_NS * 1e-9)
        heights = sensor.measure(picture, vertices, normals, offsets.variance)
        gained = np.where(missed(heights, offsets.variance) & (random_walk == 0), 0, heights.precision)
        offsets.update(picture, model.surface, k * FRAME_NS)
        mean = (precision * mean + gained * (offset + heights.mean)) / (precision + gained)
        precision = precision + gained
        matrix = dense(precision, prior)
        offset = prior.rest + np.linalg.solve(matrix, precision * (mean - prior.rest))
    np.testing.assert_allclose(offsets.variance, np.diag(np.linalg.inv(matrix)), rtol=0.1)
    np.testing.assert_array_equal(model.mesh.deviation, np.sqrt(offsets.variance))


@pytest.mark.parametrize("random_walk", [0.0, 1e-4])
def test_the_noise_of_the_first_frame_is_averaged_away_and_known_to_be(random_walk):
    generator = np.random.default_rng(3)
    true_offsets = 2e-3 * np.cos(flat_mesh().chart[:, 1] / 4)
    first = true_offsets + 1e-3 * generator.standard_normal(N)
    model = Flat(first)
    offsets = learnt(model, random_walk)
    for k in range(1, 60):
        offsets.update(
            image(offset_z(true_offsets) + SIGMA * generator.standard_normal(SHAPE)), model.surface, k * FRAME_NS
        )
    error = np.sqrt(np.mean((model.offset - true_offsets) ** 2))
    assert error < 0.2 * np.sqrt(np.mean((first - true_offsets) ** 2))
    assert 0.7 * error < np.sqrt(offsets.variance.mean()) < 1.5 * error


@pytest.mark.parametrize("random_walk", [0.0, 1.6e-3])
def test_hidden_vertices_stay(random_walk):
    generator = np.random.default_rng(4)
    true_offsets = 3e-3 * np.sin(flat_mesh().chart[:, 0])
    model = Flat(true_offsets + 0.5e-3 * generator.standard_normal(N), 0.5e-3)
    offsets = learnt(model, random_walk)
    before, known = model.offset, offsets.variance
    z = offset_z(true_offsets)
    z[:, :32] = 0.7  # something in front
    hidden = CAMERA.project(model.mesh.vertices)[:, 0] < 26
    for k in range(1, 30):
        offsets.update(image(z), model.surface, k * FRAME_NS)
    np.testing.assert_allclose(model.offset[hidden], before[hidden], atol=0.3e-3)
    assert (offsets.variance[hidden] > 0.8 * known[hidden]).all()
    assert offsets.variance[~hidden].mean() < 0.5 * offsets.variance[hidden].mean()


@pytest.mark.parametrize("random_walk", [0.0, 1.6e-3])
@pytest.mark.parametrize(("beyond", "frames", "maximum"), [(0.005, 1, 1.8e-3), (0.03, 15, 1.2e-3), (0.1, 15, 1.2e-3)])
def test_a_wild_measurement_makes_no_spike(random_walk, beyond, frames, maximum):
    """A measurement that the sensor's σ does not reject moves the vertex a little, and its effect decays."""
    model = Flat(np.zeros(N), 0.5e-3)
    offsets = learnt(model, random_walk)
    wild = np.zeros(N)
    wild[N // 2] = beyond
    for k in range(1, 30):
        offsets.update(image(offset_z(wild if k <= frames else 0 * wild)), model.surface, k * FRAME_NS)
        assert np.abs(model.offset).max() < maximum
    assert np.abs(model.offset).max() < 0.03 * beyond


@pytest.mark.parametrize(("random_walk", "minimum", "maximum"), [(0.0, 0.0, 1e-4), (1.6e-3, 2e-3, 4e-3)])
def test_what_a_whole_area_misses_is_the_models_unless_offsets_change(random_walk, minimum, maximum):
    """Each vertex alone is within three deviations, and would take it for noise of the first frame."""
    generator, model = np.random.default_rng(5), Flat(np.zeros(N), 1e-3)
    offsets = learnt(model, random_walk)
    for k in range(1, 60):
        offsets.update(image(1 - 4e-3 + SIGMA * generator.standard_normal(SHAPE)), model.surface, k * FRAME_NS)
    assert minimum <= np.median(model.offset) < maximum


def test_no_offset_moves_farther_than_half_an_edge():
    model = Flat(np.zeros(N), 0.5e-3)
    offsets = learnt(model, 1.0)  # a metre in a second: everything is believed
    for k in range(1, 100):
        offsets.update(image(1 - 2e-3 * k), model.surface, k * FRAME_NS)
    maximum = 0.5 * vertex_offsets.edges_around(model.mesh)
    assert (np.abs(model.offset) <= 1.000001 * maximum).all()
    assert np.abs(model.offset).max() > 0.9 * maximum.min()


def test_a_folded_face_is_one_that_is_turned_from_its_surface():
    model = Flat(np.zeros(N))
    vertices, normals = model.mesh.vertices.copy(), np.tile([0.0, 0.0, -1.0], (N, 1))
    assert not folded(vertices, normals, model.mesh.faces).any()
    vertices[N // 2, 2] -= 1.0  # a spike: the faces around it stand upright
    around = np.unique(model.mesh.faces[(model.mesh.faces == N // 2).any(axis=1)])
    assert set(np.flatnonzero(folded(vertices, normals, model.mesh.faces))) == set(around.tolist())
    a, b, c = (vertices[corner] for corner in model.mesh.faces.T)
    turned = np.cross(b - a, c - a)
    bad = turned @ [0.0, 0.0, -1.0] < 0.3 * np.linalg.norm(turned, axis=1)
    np.testing.assert_array_equal(
        folded(vertices, normals, model.mesh.faces), np.isin(np.arange(N), model.mesh.faces[bad])
    )


def test_folded_vertices_learn_nothing_from_their_pixels():
    offset = np.zeros(N)
    offset[N // 2] = 0.5
    model = Flat(offset, 0.5e-3)
    offsets = LearntOffsets(model, SENSOR, NOISE, 0.0)
    offsets.update(None, model.surface, 0)
    model.offset = offset  # still folded
    before = offsets.variance
    vertices, normals = (part[0].T.astype(float) for part in (model.surface.vertices, model.surface.normals))
    bad = folded(vertices, normals, model.mesh.faces)
    assert bad.any()
    offsets.update(image(1.0), model.surface, FRAME_NS)
    np.testing.assert_array_equal(offsets.variance < 0.5 * before, ~bad)


def test_models_without_offsets_have_fixed_ones():
    model = Flat(np.zeros(N))
    assert isinstance(Settings(1e-3).build(object(), SENSOR), FixedOffsets)
    assert isinstance(Settings().build(model, SENSOR), LearntOffsets)


@pytest.mark.slow
def test_learnt_offsets_reduce_the_surface_error_of_a_simulated_sheet(monkeypatch):
    from abs_service.tracking.session import TrackingSession
    from tests.abs_service.tracking.driving import default_plan, drive, mean_errors, rig_of, simulate

    simulation = simulate("simulated://sheet?seed=1")

    def error() -> float:
        session = TrackingSession(rig_of(simulation), default_plan())
        return mean_errors(list(drive(session, simulation, range(90)))[30:])[1]

    learnt_mm = error()
    monkeypatch.setattr(LearntOffsets, "update", FixedOffsets.update)
    assert learnt_mm < 0.75 * error()
