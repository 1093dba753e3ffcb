"""Every vertex has one class in every sensor, and surface beside the mesh is noticed."""

from collections.abc import Callable
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.pairing.images import ColorImage
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.terms.base import Bounds, Prediction
from abs_service.tracker.terms.depth.continuation import Continuation
from abs_service.tracker.terms.depth.depth import DepthTerm
from abs_service.tracker.terms.photometric.color import ColorTerm
from abs_service.tracker.terms.sensor_fit import Remainder, SensorFit
from abs_service.tracker.terms.vertex_counts import Tally, VertexCounts, VertexMasks
from calib.camera import Camera
from calib.noise.constant import Constant
from calib.noise.images.color import GaussianColor
from tests.abs_service.tracker.scenes import as_surface, depth_image, flat, sheet, sparse

SIGMA = 3e-3
#: Sees a sheet of 0.3 × 0.2 m at z = 1 m with room around it.
CAMERA = Camera(160, 120, 300.0, 300.0, 79.3, 59.2)
MESH = sheet(13, 19, flat)
CLASSES = [field.name for field in fields(VertexCounts) if field.name not in ("facing", "turned_away")]


def picture(size: tuple[float, float] = (0.32, 0.22), to_the_right: float = 0.0) -> np.ndarray:
    """A flat sheet of a size [m], a little larger than the mesh, before a wall [m]."""
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = rays[..., 0] / rays[..., 2], rays[..., 1] / rays[..., 2]
    on = (np.abs(x - to_the_right) < size[0] / 2) & (np.abs(y) < size[1] / 2)
    return np.where(on, 1.0, 1.6) / rays[..., 2]


def moved(x: float = 0.0, mesh: Mesh = MESH) -> Surface:
    return as_surface((mesh.vertices + np.array([x, 0, 0]), mesh.normals))


def fit(distance: np.ndarray, surface: Surface, mesh: Mesh = MESH, camera: Camera = CAMERA) -> SensorFit:
    term = DepthTerm("tof", sparse(camera, mesh), mesh, Constant(SIGMA), Bounds(0.05, 1.6, 4.6))
    term = term.observe(depth_image(distance), Prediction(surface))
    return term.fit(surface)


def counts(distance: np.ndarray, surface: Surface, mesh: Mesh = MESH) -> VertexCounts:
    return fit(distance, surface, mesh).counts


def test_all_vertices_agree_on_a_sheet_in_full_sight():
    n = len(MESH.vertices)
    assert counts(picture(), moved()) == VertexCounts(facing=n, agreeing=n)


def test_each_vertex_is_in_the_class_of_what_is_at_its_pixel():
    distance = picture()
    column, row = np.floor(CAMERA.project(MESH.vertices) + 0.5).astype(int).T
    hole, before, wrong = (
        (slice(41, 82), slice(46, 77)),
        (slice(41, 82), slice(86, 102)),
        (slice(51, 72), slice(106, 117)),
    )
    distance[hole], distance[before] = np.nan, 0.8
    distance[wrong] += 5 * SIGMA

    def within(part: tuple[slice, slice]) -> int:
        mask = np.zeros(distance.shape, bool)
        mask[part] = True
        return int(np.count_nonzero(mask[row, column]))

    found = counts(distance, moved())
    assert (found.missing, found.behind_occluder, found.disagreeing) == tuple(map(within, (hole, before, wrong)))
    assert found.agreeing == found.facing - found.missing - found.behind_occluder - found.disagreeing
    assert min(found.missing, found.behind_occluder, found.disagreeing) > 3


def test_over_the_background_vertices_disagree_with_a_wall_and_without():
    slid = moved(0.08)
    off = int(np.count_nonzero(MESH.vertices[:, 0] + 0.08 > 0.16 + 0.5 / 300))
    empty = picture()
    empty[empty > 1.3] = np.nan
    assert counts(picture(), slid).disagreeing == off
    found = counts(empty, slid)
    assert found.disagreeing + found.missing == off


def test_outside_the_image_is_a_class_of_its_own():
    out = moved(0.15)
    found = counts(picture(to_the_right=0.15), out)
    assert found.outside == np.count_nonzero(CAMERA.project(MESH.vertices + np.array([0.15, 0, 0]))[:, 0] >= 159.5)
    assert found.agreeing == found.facing - found.outside


def test_what_the_mesh_itself_hides_is_not_expected_in_sight():
    """A sheet whose right third is folded over its middle: the flap turns its back, what is under it is hidden."""
    mesh = sheet(9, 31, lambda x, y: np.where(x > 0.05, 0.9, 1.0))
    vertices = mesh.vertices.copy()
    right = vertices[:, 0] > 0.05
    vertices[right, 0] = 0.1 - vertices[right, 0]
    bent = Mesh(vertices, mesh.faces, mesh.colors, mesh.chart)
    found = counts(picture(), moved(mesh=bent), bent)
    assert found.behind_itself > 20
    assert found.facing < len(vertices)
    assert found.expected == sum(getattr(found, name) for name in CLASSES) - found.behind_itself


def test_a_colour_camera_has_the_same_classes():
    image = ColorImage(np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8))
    colors = np.zeros_like(MESH.colors)
    colors[:40], colors[40:60] = 200.0, np.nan
    term = ColorTerm("color", sparse(CAMERA, MESH), colors, GaussianColor(), Bounds(0.05, 16, 19))
    term = term.observe(image, Prediction(moved()))
    found = term.fit(moved()).counts
    unknown = len(MESH.vertices) - 60
    assert found == VertexCounts(facing=len(MESH.vertices), agreeing=unknown, disagreeing=40)


@given(st.integers(0, 2**32 - 1), st.integers(0, 50))
def test_each_sample_is_counted_once(seed: int, n: int):
    """An occluder comes before a missing return, and both before what is not judged."""
    generator = np.random.default_rng(seed)
    pixel = generator.integers(-1, 3, n).astype(np.int32)
    facing, missing, covered, unjudged, measured = generator.random((5, n)) < 0.5
    residual = generator.uniform(0, 2, n)
    agreeing = measured & (residual < 1)
    inside, hidden = pixel > 0, covered | missing
    visible = inside & ~(hidden | unjudged)
    masks = (
        visible,
        inside & missing & ~covered,
        inside & covered,
        (pixel < 0) & facing,
        (pixel == 0) & facing,
        inside & unjudged & ~hidden,
        visible & measured,
        visible & agreeing,
        measured,
        agreeing,
    )
    found, squares = VertexMasks(pixel, facing, missing, covered, unjudged).tally(measured, residual, 1.0)
    assert squares == pytest.approx(np.sum(residual[agreeing] ** 2))
    assert found == Tally(*(int(np.count_nonzero(mask)) for mask in masks))
    assert found.of(n).facing + found.of(n).turned_away == n


@pytest.mark.parametrize("name", CLASSES)
def test_shares_are_of_the_vertices_that_face_the_sensor(name: str):
    assert VertexCounts(facing=50, **{name: 20}).share(name) == 0.4
    assert VertexCounts().share(name) == 0.0


def remainder(size: tuple[float, float]) -> Callable[[Surface], Remainder]:
    """Remainder of a sheet of a size in its first image."""
    return Continuation(CAMERA, MESH).observe(picture(size) < 1.3)


def test_nothing_is_left_of_a_sheet_that_the_mesh_covers():
    assert remainder((0.32, 0.22))(moved()).share < 0.01


def test_what_is_left_is_measured_near_the_mesh():
    """A mesh of 0.3 × 0.2 m; what lies within a cell of it, or farther than a quarter of its side, does not count."""
    cell, side = 0.3 / 18, np.sqrt(0.3 * 0.2)
    for wider in (0.06, 0.1):
        beside = 2 * (wider / 2 - cell) * 0.2
        found = remainder((0.3 + wider, 0.2))(moved())
        assert found.share == pytest.approx(beside / (beside + 0.06), abs=0.03)  # the grid has 7 mm
        assert found.share == found.at_first
    reach = side / 4
    wall = remainder((9.0, 9.0))(moved()).share
    around = 2 * (0.3 + 0.2) * reach + np.pi * ((reach + cell) ** 2 - cell**2)
    assert wall == pytest.approx(around / (around + 0.06), rel=0.1)


def test_a_mesh_that_slides_leaves_surface_behind():
    left = remainder((0.32, 0.22))
    assert left(moved()).gained == 0.0
    assert left(moved(0.08)).gained == pytest.approx(0.2, abs=0.05)
    assert left(moved(0.0)).gained == 0.0


def test_what_is_left_in_a_frame_does_not_change_with_the_next():
    lasting = Continuation(CAMERA, MESH)
    first = lasting.observe(picture((0.36, 0.2)) < 1.3)
    share = first(moved()).share
    assert lasting.observe(picture((0.4, 0.2)) < 1.3)(moved()).share > share
    assert first(moved()).share == share


def test_only_the_window_is_looked_at():
    whole, part = Continuation(CAMERA, MESH), Continuation(CAMERA, MESH)
    shown = picture((0.4, 0.2)) < 1.3
    window = (slice(21, 101), slice(3, 157))
    left, left_in_part = whole.observe(shown), part.observe(shown[window], window)
    assert left(moved()).share == left_in_part(moved()).share > 0


def test_without_the_object_the_remainder_is_unknown():
    nothing = np.zeros((CAMERA.height, CAMERA.width), bool)
    found = Continuation(CAMERA, MESH).observe(nothing)(moved())
    assert np.isnan(found.share)
    assert found.gained == 0.0
