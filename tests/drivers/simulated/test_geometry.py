"""The simulated sheet: isometry, smooth motion, and ray casting."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import root_scalar

from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from drivers.simulated import scenes
from drivers.simulated.scene.motion import Placement
from drivers.simulated.scene.raycast import cast, lookup, shadowed
from drivers.simulated.scene.scene import REST_Z, WALL_Z, Moment, Scene
from drivers.simulated.scene.surface import surface_points
from drivers.simulated.sensors.view import View
from drivers.simulated.settings import Settings
from drivers.simulated.shapes.rectangle import PlacedRectangle, Rectangle

CURVATURES = st.sampled_from([0.0, 1e-12, -1e-9, 1e-7, -1e-5]) | st.floats(-4, 4)
PLACEMENTS = st.builds(
    lambda rotation, x, y, z, curvature, direction, offset: Placement(
        pose.from_rotation_vector(rotation, (x, y, z)), curvature, direction, offset
    ),
    st.tuples(*[st.floats(-0.25, 0.25)] * 3),
    st.floats(-0.05, 0.05),
    st.floats(-0.05, 0.05),
    st.floats(0.8, 1.2),
    CURVATURES,
    st.floats(-4, 4),
    st.floats(-0.03, 0.03),
)
SHEET, BOARD = scenes.sheet(Settings("sheet")), scenes.board(Settings("board"))
CAMERA = Camera(40, 30, 40.0, 40.0, 19.5, 14.5)


def rectangle(world: Scene) -> Rectangle:
    (surface,) = world.surfaces
    assert isinstance(surface, Rectangle)
    return surface


def moment(placement: Placement) -> Moment:
    return Moment((PlacedRectangle(0.3, 0.2, rectangle(SHEET).texture, placement),))


def shape_of(placement: Placement) -> np.ndarray:
    direction = placement.direction
    return np.array([placement.curvature, np.cos(direction), np.sin(direction), placement.offset, 0.15, 0.10])


@given(PLACEMENTS, st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(0, 2 * np.pi))
def test_straight_lines_on_the_sheet_keep_their_length(
    placement: Placement, a: float, b: float, heading: float
) -> None:
    steps = np.linspace(0, 0.05, 2001)
    line = surface_points(placement, a + steps * np.cos(heading), b + steps * np.sin(heading))
    length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
    assert length == pytest.approx(0.05, abs=1e-6)


@given(PLACEMENTS)
def test_the_first_fundamental_form_is_the_identity(placement: Placement) -> None:
    a, b = np.meshgrid(np.linspace(-0.15, 0.15, 7), np.linspace(-0.1, 0.1, 5))
    h = 1e-5
    along_a = (surface_points(placement, a + h, b) - surface_points(placement, a - h, b)) / (2 * h)
    along_b = (surface_points(placement, a, b + h) - surface_points(placement, a, b - h)) / (2 * h)
    np.testing.assert_allclose(np.linalg.norm(along_a, axis=-1), 1, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(along_b, axis=-1), 1, atol=1e-6)
    np.testing.assert_allclose((along_a * along_b).sum(-1), 0, atol=1e-6)


@given(PLACEMENTS)
def test_rays_end_at_the_reported_material_point(placement: Placement) -> None:
    T_bs = np.ascontiguousarray(pose.inverse(placement.T_rb))
    sight, share = cast(CAMERA.rays(), T_bs, shape_of(placement))
    distance, a, b, cosine = sight.astype(float)
    seen = share == 1
    assert seen.any()
    points = surface_points(placement, a[seen], b[seen])
    np.testing.assert_allclose(points, (CAMERA.rays() * distance[..., None])[seen], atol=1e-6)
    assert np.all(np.isnan(distance[~seen]))
    assert np.all((cosine[seen] > 0) & (cosine[seen] <= 1 + 1e-6))


@given(PLACEMENTS)
def test_the_cosine_of_incidence_is_that_of_the_normal(placement: Placement) -> None:
    T_bs = np.ascontiguousarray(pose.inverse(placement.T_rb))
    sight, share = cast(CAMERA.rays(), T_bs, shape_of(placement))
    seen = share == 1
    _, a, b, cosine = sight[:, seen].astype(float)
    h = 1e-5
    along_a = surface_points(placement, a + h, b) - surface_points(placement, a - h, b)
    along_b = surface_points(placement, a, b + h) - surface_points(placement, a, b - h)
    normal = np.cross(along_a, along_b)
    expected = np.abs((normal * CAMERA.rays()[seen]).sum(-1)) / np.linalg.norm(normal, axis=-1)
    np.testing.assert_allclose(cosine, expected, atol=1e-5)


def test_the_nearest_of_two_intersections_is_returned() -> None:
    """In the side view of a strongly bent sheet, both flanks lie on one ray."""
    placement = Placement(pose.from_rotation_vector((0, np.pi / 2, 0), (0, 0, 1)), curvature=12.0)
    ray = np.array([[[0.02, 0.0, 1.0]]]) / np.hypot(0.02, 1.0)
    distance = cast(ray, np.ascontiguousarray(pose.inverse(placement.T_rb)), shape_of(placement))[0][0, 0, 0]

    def point(s: float) -> np.ndarray:
        return surface_points(placement, np.array(s), np.array(0.0))

    flanks = [
        root_scalar(lambda s: point(s)[0] - 0.02 * point(s)[2], bracket=ends).root for ends in ((-0.15, 0), (0, 0.15))
    ]
    distances = [np.linalg.norm(point(s)) for s in flanks]
    assert abs(distances[0] - distances[1]) > 0.05
    assert distance == pytest.approx(min(distances), abs=1e-6)


@pytest.mark.parametrize("lens", [Lens(), Lens(np.array([-0.2, 0.05, 0.001, -0.001]))])
def test_the_coverage_of_rims_is_their_area(lens: Lens) -> None:
    """The coverage of all pixels adds up to the projected area of the flat sheet."""
    camera = Camera(176, 144, 220.0, 220.0, 87.5, 71.5, lens)
    (sight,) = View(SHEET, camera).look(moment(Placement(pose.from_rotation_vector((0, 0, 0.3), (0, 0, 1)))))
    corners = [(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)]
    rim = np.concatenate([np.linspace(p, q, 50, endpoint=False) for p, q in zip(corners, corners[1:] + corners[:1])])
    outline = camera.project(surface_points(Placement(pose.from_rotation_vector((0, 0, 0.3), (0, 0, 1))), *rim.T))
    u, v = outline.T
    area = 0.5 * abs(np.dot(u, np.roll(v, -1)) - np.dot(v, np.roll(u, -1)))
    assert sight.share.sum() == pytest.approx(area, rel=2e-3)
    assert np.any((sight.share > 0) & (sight.share < 1))


def test_a_sheet_out_of_view_is_an_empty_region() -> None:
    view = View(SHEET, CAMERA)
    for elsewhere in ((5.0, 0.0, 1.0), (0.0, 0.0, -1.0)):
        assert view.look(moment(Placement(pose.from_rotation_vector((0, 0, 0), elsewhere))))[0].share.size == 0


def test_the_wall_is_a_plane() -> None:
    camera = Camera(40, 30, 40.0, 40.0, 19.5, 14.5, T_rs=pose.from_rotation_vector((0.1, 0.2, 0), (0.1, 0, 0.2)))
    points = camera.unproject(View(SHEET, camera).wall.distance)
    np.testing.assert_allclose(points[..., 2], WALL_Z, atol=1e-6)


def test_shadow_lies_where_the_sheet_is_between_light_and_point() -> None:
    shape = shape_of(Placement(pose.identity()))
    points = np.array([[[0.0, 0.0, 0.5], [0.29, 0.0, 0.5], [0.31, 0.0, 0.5], [0.0, 0.0, 0.0], [0.0, 0.0, -0.5]]])
    dark = shadowed(points, np.array([0.0, 0.0, -0.5]), shape)
    np.testing.assert_array_equal(dark, [[True, True, False, False, False]])


def test_textures_are_interpolated_and_end_at_their_edge() -> None:
    texture = np.arange(6, dtype=np.float32).reshape(2, 3, 1)
    columns = np.array([[0.0, 0.5, 2.0, 9.0, -1.0, np.nan]], np.float32)
    rows = np.array([[0.0, 0.5, 1.0, 9.0, 0.0, 0.0]], np.float32)
    np.testing.assert_allclose(lookup(texture, columns, rows)[0, :, 0], [0, 2, 5, 5, 0, 0])


@pytest.mark.parametrize("world", [SHEET, BOARD])
def test_motion_begins_at_rest_and_stays_within_reach(world: Scene) -> None:
    points = np.array([world.surfaces[0].at(k / 30).grid(5, 7) for k in range(600)])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    assert np.all(steps[:30] == 0)
    assert np.all(np.abs(points[0][..., 2] - REST_Z) < 1e-12)
    assert steps.max() < 0.010
    assert np.median(steps[120:].max(axis=(1, 2))) > 0.002
    assert np.abs(np.diff(steps, axis=0)).max() < 0.002
    normals = np.cross(np.gradient(points, axis=2), np.gradient(points, axis=1))
    cosines = (normals * points).sum(-1) / np.linalg.norm(normals, axis=-1) / np.linalg.norm(points, axis=-1)
    assert np.abs(cosines).min() > 0.4


def test_only_the_sheet_bends() -> None:
    sheet, board = rectangle(SHEET).motion, rectangle(BOARD).motion
    assert max(abs(sheet.at(k / 30).curvature) for k in range(600)) > 2.0
    assert all(board.at(k / 30).curvature == 0 for k in range(600))
