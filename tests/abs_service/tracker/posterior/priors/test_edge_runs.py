"""Edges in runs cost what edges cost one by one, whatever the mesh."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.detection.grid_mesh import triangles
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.nurbs import Settings as Nurbs
from abs_service.tracker.posterior.priors.edge_runs import EdgeRuns
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from tests import reference
from tests.abs_service.tracker.scenes import as_surface, sheet
from tests.abs_service.tracker.synthesis.random_vertices import few, seeds


def grid_with_holes(generator: np.random.Generator, rows: int, columns: int, share: float) -> Mesh:
    """A grid some of whose vertices are missing, so rows begin and end anywhere."""
    there = generator.random((rows, columns)) >= share
    whole, place = sheet(rows, columns), np.where(there, np.cumsum(there).reshape(rows, columns) - 1, -1)
    kept, faces = there.ravel(), triangles(place).astype(np.int32)
    return Mesh(whole.vertices[kept], faces, whole.colors[kept], whole.chart[kept])


def without_order(generator: np.random.Generator, vertices: int, faces: int) -> Mesh:
    """Triangles between any vertices."""
    corners = np.array([generator.permutation(vertices)[:3] for _ in range(faces)], np.int32).reshape(-1, 3)
    unknown = np.full((vertices, 3), np.nan, np.float32)
    return Mesh(generator.uniform(0, 0.3, (vertices, 3)), corners, unknown, np.zeros((vertices, 2)))


def sorted_by_part(generator: np.random.Generator, mesh: Mesh) -> Mesh:
    """The vertices of parts of the mesh after each other, in their former order: so knot spans sort a NURBS."""
    part = np.floor(mesh.chart / generator.uniform(2, 9, 2)) @ (100, 1)
    return mesh.reordered(np.argsort(part, kind="stable"))


def runs_of(mesh: Mesh) -> EdgeRuns:
    return EdgeRuns(mesh.edges, np.ones(len(mesh.edges), np.float32), len(mesh.vertices))


def check_cost(generator: np.random.Generator, mesh: Mesh) -> None:
    moved = mesh.vertices + generator.normal(0, 2e-3, (3, *mesh.vertices.shape))
    costs = StretchPrior(mesh, 0.02).cost(as_surface(*((vertices, vertices) for vertices in moved)))
    seen = moved.astype(np.float32).astype(float)
    expected = [reference.stretch_cost(mesh.vertices, vertices, mesh.edges, 0.02) for vertices in seen]
    np.testing.assert_allclose(costs, expected, rtol=2e-4)


@few
@given(seeds, st.integers(2, 14), st.integers(2, 40), st.sampled_from([0.0, 0.05, 0.3]))
def test_grids_with_holes_cost_what_their_edges_do(seed, rows, columns, share):
    generator = np.random.default_rng(seed)
    check_cost(generator, grid_with_holes(generator, rows, columns, share))


@few
@given(seeds, st.integers(2, 14), st.integers(2, 24), st.sampled_from([0.0, 0.2]), st.booleans())
def test_vertices_may_come_in_any_order(seed, rows, columns, share, parts):
    generator = np.random.default_rng(seed)
    mesh = grid_with_holes(generator, rows, columns, share)
    order = generator.permutation(len(mesh.vertices))
    check_cost(generator, sorted_by_part(generator, mesh) if parts else mesh.reordered(order))


@few
@given(seeds, st.integers(3, 60), st.integers(0, 80))
def test_a_mesh_without_order_costs_what_its_edges_do(seed, vertices, faces):
    generator = np.random.default_rng(seed)
    check_cost(generator, without_order(generator, vertices, faces))


@few
@given(seeds, st.integers(2, 14), st.integers(2, 40))
def test_runs_stay_within_the_mesh(seed, rows, columns):
    """Values read out of bounds would not change the cost."""
    mesh = grid_with_holes(np.random.default_rng(seed), rows, columns, 0.1)
    runs = runs_of(mesh).runs
    assert np.all(runs[:, 0] >= 0)
    assert np.all(runs[:, 1] + runs[:, 2] <= len(mesh.vertices))


@pytest.mark.parametrize(
    ("minimum", "mesh"), [(0.99, sheet(17, 18)), (0.9, Nurbs((4, 4), 2).of_mesh(sheet(17, 18)).mesh)]
)
def test_most_edges_of_a_grid_are_in_few_runs(minimum, mesh):
    found = runs_of(mesh)
    assert len(found.singles) < (1 - minimum) * len(mesh.edges)
    assert len(found.runs) < 30
    assert found.runs[:, 2].sum() < 1.3 * len(mesh.edges)


def test_a_mesh_without_order_has_its_edges_as_they_were():
    mesh = without_order(np.random.default_rng(3), 500, 300)
    found = runs_of(mesh)
    assert len(found.runs) == 0
    np.testing.assert_array_equal(found.singles, mesh.edges)
