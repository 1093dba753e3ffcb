"""FlexPad: summed bends of eight sides, height map and pose."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.detection.shapes.sheet_mesh import Sheet
from abs_service.tracker.models.base import ModelError
from abs_service.tracker.models.flexpad import FULL_HEIGHT, FlexPad, Settings
from abs_service.tracker.models.parts import bends
from calib import pose
from drivers.simulated.scene.motion import Placement
from drivers.simulated.scene.surface import surface_points
from tests import reference

A4 = (0.297, 0.210)


RADIUS = 0.1


T_RP = pose.from_rotation_vector([0.2, -0.3, 0.1], [0.05, -0.02, 0.9])


MODEL = FlexPad(Sheet(T_RP, *A4), 150, RADIUS, 1.0)


MESH = MODEL.mesh


PLACES = pose.transform(pose.inverse(T_RP), MESH.vertices)[:, :2]


seeds = st.integers(0, 2**32 - 1)


def theta_of(*bends_of_sides: float, height: float = 0.0) -> np.ndarray:
    return np.concatenate([bends_of_sides, np.zeros(8 - len(bends_of_sides)), [height], np.zeros(6)])


def bend(**sides: float) -> np.ndarray:
    """Parameters with bends by name: e (+0°), w (−0°), se (+45°), nw, s (+90°), n, sw (+135°), ne; y points down."""
    order = ["e", "w", "se", "nw", "s", "n", "sw", "ne"]
    return theta_of(*[sides.get(name, 0.0) for name in order])


def vertices_of(theta: np.ndarray, model: FlexPad = MODEL) -> np.ndarray:
    return model.deform(theta[None]).vertices[0].T.astype(float)


def in_plane(theta: np.ndarray) -> np.ndarray:
    """Vertices in the frame of the sheet: x right, y down, z away from the sensor."""
    return pose.transform(pose.inverse(T_RP), vertices_of(theta))


def stretches(theta: np.ndarray, model: FlexPad = MODEL) -> np.ndarray:
    """Relative changes of the edges' lengths."""
    (i, j), rest = model.mesh.edges.T, model.mesh.vertices
    now = vertices_of(theta, model)
    return np.linalg.norm(now[i] - now[j], axis=1) / np.linalg.norm(rest[i] - rest[j], axis=1) - 1


def test_without_bends_the_sheet_is_flat_and_where_it_was():
    surface = MODEL.deform(MODEL.rest[None])
    np.testing.assert_allclose(surface.vertices[0].T, MESH.vertices, rtol=0, atol=1e-7)
    np.testing.assert_allclose(surface.normals[0].T, np.tile(-T_RP[:3, 2], (len(PLACES), 1)), atol=1e-6)


@given(seed=seeds, size=st.sampled_from([1e-12, 1e-6, 1e-3, 1.0, 1.5]))
def test_deformation_is_the_sum_of_exact_bends(seed, size):
    """Includes weak bends, where quotients suffer from rounding; parameters outside their range are clamped."""
    generator = np.random.default_rng(seed)
    theta = size * generator.uniform(-2, 2, 15) * ([1.0] * 8 + [0.3] * 4 + [0.1] * 3)
    theta[generator.integers(8)] = 0.0
    some = generator.choice(len(PLACES), 12, replace=False)
    surface = MODEL.deform(theta[None])
    expected = np.array([reference.flexpad(theta, place, T_RP, A4[0] / 2, RADIUS) for place in PLACES[some]])
    np.testing.assert_allclose(surface.vertices[0].T[some], expected, rtol=0, atol=5e-7)
    normals = np.array([reference.flexpad_normal(theta, place, T_RP, A4[0] / 2, RADIUS) for place in PLACES[some]])
    np.testing.assert_allclose(surface.normals[0].T[some], normals, rtol=0, atol=1e-3)


def turns_up_to(turns: float) -> float:
    """Least radius at which the corners of the A4 sheet's mesh roll up by a number of turns."""
    return float(np.linalg.norm(PLACES, axis=1).max()) / (2 * np.pi * turns)


@pytest.mark.parametrize(("turns", "degree"), bends.DEGREES.items())
def test_the_series_are_as_exact_as_they_promise_and_not_much_more(turns, degree):
    series = bends.fit(0.1, 0.1 / (2 * np.pi * turns) * (1 + 1e-12))
    assert series.coefficients.shape == (2, degree + 1)
    t = np.linspace(1e-3, 2 * np.pi * turns, 2000)
    exact = np.sin(t) / t, (1 - np.cos(t)) / t**2
    sine, versine = (np.polyval(c, series.scale * t**2 - 1) for c in series.coefficients.astype(float))
    error = np.hypot(sine - exact[0], t * (versine - exact[1])).max()
    print(f"{turns:.2f} turns: degree {degree}, error {error:.1e} of the distance from the centre")
    assert error < (2e-7 if turns < 1 else 2e-6)  # single precision dominates the error of the polynomial


@pytest.mark.parametrize(("turns", "tolerance"), [(0.3, 5e-7), (0.6, 5e-7), (1.3, 1e-6), (2.99, 3e-6)])
def test_a_sheet_that_rolls_up_several_times_is_exact_to_a_few_micrometres(turns, tolerance):
    radius = turns_up_to(turns)
    model = FlexPad(Sheet(T_RP, *A4), 150, radius, 1.0)
    generator = np.random.default_rng(0)
    thetas = [theta_of(*np.eye(8)[side] * value) for side in range(8) for value in (-2.0, 2.0)]
    for theta in [*thetas, *np.concatenate([generator.uniform(-2, 2, (20, 8)), np.zeros((20, 7))], axis=1)]:
        expected = [reference.flexpad(theta, place, T_RP, A4[0] / 2, radius) for place in PLACES[::-4]]
        np.testing.assert_allclose(vertices_of(theta, model)[::-4], expected, rtol=0, atol=tolerance)


def test_a_sheet_that_would_roll_up_more_often_is_refused_with_what_is_allowed():
    least, most = turns_up_to(3.5), turns_up_to(3.0)
    message = rf"minimum_radius_m = {least:g} would roll up .* by 3.5 turns; 3 are allowed, .* at least 0.009"
    with pytest.raises(ModelError, match=message):
        FlexPad(Sheet(T_RP, *A4), 150, least, 1.0)
    FlexPad(Sheet(T_RP, *A4), 150, most * (1 + 1e-9), 1.0)


@pytest.mark.parametrize("side", range(8))
@pytest.mark.parametrize("value", [-2.0, 0.7, 2.0])
def test_a_single_bend_keeps_all_lengths(side, value):
    """An edge of length l becomes a chord, shorter by the relative amount (κl)²/24; rounding adds 0.002 %."""
    theta = theta_of(*np.eye(8)[side] * value)
    lengths = np.linalg.norm(np.diff(MESH.vertices[MESH.edges], axis=1)[:, 0], axis=1)
    chord = (value / (2 * RADIUS) * lengths) ** 2 / 24
    change = stretches(theta)
    assert np.all(change < 2e-5)
    assert np.all(change > -1.01 * chord - 2e-5)


@pytest.mark.parametrize("direction", range(4))
@pytest.mark.parametrize("value", [-1.5, 1.0, 2.0])
def test_two_sides_of_a_direction_make_the_simulator_s_cylinder(direction, value):
    theta = theta_of(*np.repeat(np.eye(4)[direction] * value, 2))
    placement = Placement(T_RP, curvature=-value / (2 * RADIUS), direction=np.deg2rad(45 * direction))
    expected = surface_points(placement, *PLACES.T)
    assert np.linalg.norm(vertices_of(theta) - expected, axis=1).max() < 1e-6


@pytest.mark.parametrize(
    ("name", "corner"),
    [("e", (1, 0)), ("w", (-1, 0)), ("s", (0, 1)), ("n", (0, -1)), ("se", (1, 1)), ("nw", (-1, -1)), ("sw", (-1, 1))],
)
def test_positive_bends_rise_towards_the_sensor_on_their_side_only(name, corner):
    rise = -in_plane(bend(**{name: 1.0}))[:, 2]
    along = PLACES @ corner
    assert np.all(rise[along <= 0] < 1e-6)
    assert np.all(rise[along > 0.02] > 1e-4)
    assert np.linalg.norm(vertices_of(bend(**{name: 1.0})), axis=1)[np.argmax(along)] < np.linalg.norm(
        MESH.vertices[np.argmax(along)]
    )


def test_the_height_map_changes_heights_and_nothing_else():
    flat, mapped = in_plane(bend(e=1.5, n=-1.0)), in_plane(bend(e=1.5, n=-1.0) + theta_of(height=0.4))
    np.testing.assert_allclose(mapped[:, :2], flat[:, :2], atol=1e-6)
    z = -flat[:, 2]
    np.testing.assert_allclose(-mapped[:, 2], z + 0.4 * z**2 / (A4[0] / 2), atol=1e-6)
    assert np.ptp(z) > 0.05


def test_the_pose_turns_about_the_centre():
    T = pose.from_rotation_vector([0.3, -0.5, 0.2], [0, 0, 0])
    theta = bend(e=1.0, s=-0.5)
    moved = theta + np.concatenate([np.zeros(9), [0.3, -0.5, 0.2], [0.1, 0.2, -0.3]])
    surface = MODEL.deform(np.stack([theta, moved]))
    center = T_RP[:3, 3]
    expected = pose.transform(T, surface.vertices[0].T - center) + center + [0.1, 0.2, -0.3]
    np.testing.assert_allclose(surface.vertices[1].T, expected, atol=1e-6)
    np.testing.assert_allclose(surface.normals[1].T, surface.normals[0].T @ T[:3, :3].T, atol=1e-6)


@given(seed=seeds)
def test_every_candidate_is_deformed_by_itself(seed):
    thetas = np.random.default_rng(seed).normal(0, 0.7, (4, 15))
    together = MODEL.deform(thetas)
    for k in range(4):
        alone = MODEL.deform(thetas[k : k + 1])
        np.testing.assert_array_equal(together.vertices[k], alone.vertices[0])
        np.testing.assert_array_equal(together.normals[k], alone.normals[0])


def test_scales_move_the_farthest_vertex_by_about_a_metre():
    bent = bend(e=1, w=1, se=1, nw=1, s=1, n=1, sw=1, ne=1)
    for parameter, scale in enumerate(MODEL.scales):
        step = np.zeros(15)
        step[parameter] = 1e-3 * scale
        moved = np.linalg.norm(vertices_of(bent + step) - vertices_of(bent - step), axis=1).max() / 2
        assert 0.5e-3 < moved < 5e-3, parameter


def test_what_is_known_of_bends_and_height_keeps_them_in_range():
    """Bends are clamped at ±2, but the prior keeps rising, so that the optimum never lies outside the range."""
    inside, outside = bend(e=2.0), bend(e=2.6)
    np.testing.assert_array_equal(vertices_of(inside), vertices_of(outside))
    costs = 0.5 * np.sum((MODEL.prior @ np.stack([inside, outside]).T) ** 2, axis=0)
    assert costs == pytest.approx([2.0, 0.5 * 2.6**2])
    assert not MODEL.prior[:, 9:].any()
    assert (MODEL.prior @ theta_of(height=FULL_HEIGHT))[8] == pytest.approx(2.5)


@pytest.mark.parametrize(
    ("sizes", "given"),
    [({"width_m": 0.3}, "width_m = 0.3, height_m = 0.0"), ({"height_m": 0.2}, "width_m = 0.0, height_m = 0.2")],
)
def test_half_a_size_is_refused(sizes, given):
    with pytest.raises(ValueError, match=f"{given}: they belong together; give both, or neither"):
        Settings(**sizes)


@pytest.mark.parametrize("sides", [("e", "w", "se", "nw"), ("e", "w", "s", "n")])
def test_bends_of_several_directions_change_lengths_to_second_order_only(sides):
    """Sums of isometric bends are isometric to first order: half the bends change lengths by about a quarter."""
    half, whole = (np.abs(stretches(bend(**dict.fromkeys(sides, value)))).max() for value in (0.5, 1.0))
    print(f"{' + '.join(sides)}: edges change by up to {half:.1%} at 0.5, {whole:.1%} at 1")
    assert 3 < whole / half < 5
    assert whole < 0.3


COLLAPSED = bend(e=1, w=1, s=1, n=1, se=-1, nw=-1, sw=-1, ne=-1)


def test_opposite_bends_shrink_a_sheet_that_stays_nearly_flat():
    """The local optimum exists: without the stretch prior only the background beside the sheet penalises it."""
    there = in_plane(COLLAPSED)
    assert np.abs(there[:, 2]).max() < 6e-3
    assert np.ptp(there[:, 0]) < 0.9 * np.ptp(PLACES[:, 0])
    assert np.ptp(there[:, 1]) < 0.96 * np.ptp(PLACES[:, 1])
