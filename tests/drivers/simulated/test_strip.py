"""The sagging strip: equilibrium and ray casting."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_bvp
from scipy.spatial import KDTree

from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from drivers.simulated.address import parse
from drivers.simulated.shapes.elastica import solve_elastica
from drivers.simulated.shapes.strip import GRAVITY, PlacedStrip, Strip
from drivers.simulated.simulation import Simulation

CAMERA = Camera(176, 144, 220.0, 220.0, 87.5, 71.5)
RAYS = np.ascontiguousarray(CAMERA.rays())


def build(query: str) -> Simulation:
    return parse(f"simulated://strip?{query}").build()


def strip_of(simulation: Simulation) -> Strip:
    (strip,) = simulation.scene.surfaces
    assert isinstance(strip, Strip)
    return strip


STILL = build("sensors=tof&speed=0&noise=0")


def placed(clamp: float, load: float, turn: float, x: float, z: float) -> PlacedStrip:
    T_rp = pose.from_rotation_vector((0, np.pi / 2 + turn, 0), (x, -0.13, z))
    return PlacedStrip(0.05, strip_of(STILL).texture, T_rp, solve_elastica(0.30, load, clamp))


PLACED = st.builds(
    placed, st.floats(0.4, 1.3), st.floats(1, 500), st.floats(-0.6, 0.6), st.floats(-0.05, 0.05), st.floats(0.95, 1.2)
)


@pytest.mark.parametrize(
    ("stiffness", "weight"), [(0.01, 0.3), (0.003, 0.2), (0.05, 0.3), (0.0005, 0.08), (0.002, 2.0)]
)
@pytest.mark.parametrize("clamp_deg", [40, 55, 70])
def test_the_shape_solves_the_boundary_value_problem(stiffness: float, weight: float, clamp_deg: float) -> None:
    length, load, clamp = 0.30, weight * GRAVITY / stiffness, np.deg2rad(clamp_deg)
    s = np.linspace(0, length, 400)
    solution = solve_bvp(
        lambda s, y: np.stack([y[1], load * (length - s) * np.sin(y[0]), np.sin(y[0]), np.cos(y[0])]),
        lambda a, b: np.array([a[0] - clamp, b[1], a[2], a[3]]),
        s,
        np.stack([clamp * (1 - s / length) ** 3, -3 * clamp / length * (1 - s / length) ** 2, 0 * s, s]),
        tol=1e-6,
    )
    assert solution.success
    profile = solve_elastica(length, load, clamp)
    angle, _, reach, drop = solution.sol(profile.s)
    np.testing.assert_allclose(profile.angle, angle, atol=1e-5)
    np.testing.assert_allclose(profile.reach, reach, atol=1e-6)
    np.testing.assert_allclose(profile.drop, drop, atol=1e-6)


@given(st.floats(0.3, 1.2), st.floats(0.1, 0.5))
def test_a_stiff_strip_bends_as_a_beam(clamp: float, length: float) -> None:
    load = 1e-3 / length**3
    profile = solve_elastica(length, load, clamp)
    away = profile.drop[-1] * np.sin(clamp) - profile.reach[-1] * np.cos(clamp)  # across the clamped direction
    assert away == pytest.approx(load * np.sin(clamp) * length**4 / 8, rel=1e-2)


@given(st.floats(0.2, 1.3), st.floats(1, 2000))
def test_chords_are_as_long_as_the_strip_and_near_its_curve(clamp: float, load: float) -> None:
    profile, whole = solve_elastica(0.30, load, clamp), np.linspace(0, 1, 129)
    nodes = np.stack([profile.reach, profile.drop], axis=1)
    chords = np.diff(nodes, axis=0)
    assert np.linalg.norm(chords, axis=1).sum() == pytest.approx(0.30, abs=1e-5)
    sagitta = np.linalg.norm(chords, axis=1) * np.abs(np.diff(profile.angle)) / 8
    assert sagitta.max() < 0.05e-3
    assert profile.s == pytest.approx(0.30 * whole)


@pytest.mark.parametrize("k", [0, 150, 300])
def test_the_bending_moment_balances_the_weight_beyond(k: int) -> None:
    """The bending moment from the curvature equals that of the weight beyond, which acts along the rig's y axis."""
    simulation = build("sensors=tof&stiffness=0.02&weight=0.4")
    line = simulation.scene.at(k / 30).surfaces[0].grid(3, 129)[1]  # as many points as the curve has nodes
    step = 0.30 / 128
    tangents = np.diff(line, axis=0) / step
    moments = 0.02 * np.linalg.norm(np.diff(tangents, axis=0), axis=1) / step
    middles, force = 0.5 * (line[1:] + line[:-1]), np.array([0.0, 0.4 * GRAVITY * step, 0.0])
    beyond = [np.linalg.norm(np.cross(middles[i:] - line[i], force).sum(axis=0)) for i in range(1, 128)]
    np.testing.assert_allclose(moments, beyond, atol=2e-3 * float(max(beyond)))


@settings(max_examples=25)
@given(PLACED)
def test_rays_end_at_material_points(strip: PlacedStrip) -> None:
    seen = strip.cast(RAYS, pose.identity())
    hit = seen.share == 1
    assert hit.any()
    grid = strip.grid(101, 601)
    normals = np.cross(np.gradient(grid, axis=1), np.gradient(grid, axis=0)).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points, rays = (RAYS * seen.distance[..., None])[hit][::7], RAYS[hit][::7]
    closest = KDTree(grid.reshape(-1, 3)).query(points)[1]
    offsets = ((points - grid.reshape(-1, 3)[closest]) * normals[closest]).sum(axis=1)
    assert np.abs(offsets).max() < 0.05e-3
    expected = np.abs((normals[closest] * rays).sum(axis=1))
    np.testing.assert_allclose(seen.cosine[hit][::7], expected, atol=0.02)


@settings(max_examples=10)
@given(PLACED)
def test_the_texture_stays_on_the_material(strip: PlacedStrip) -> None:
    seen = strip.cast(RAYS, pose.identity())
    grid = strip.grid(41, 241)
    s, across = np.meshgrid(np.linspace(-0.15, 0.15, 241), np.linspace(-0.025, 0.025, 41))
    expected = strip.texture.at(s.astype(np.float32), across.astype(np.float32)).reshape(-1, 4)
    hit = seen.share == 1
    closest = KDTree(grid.reshape(-1, 3)).query((RAYS * seen.distance[..., None])[hit])[1]
    assert np.abs(seen.albedo[hit] - expected[closest]).mean() < 0.02


@pytest.mark.parametrize("lens", [Lens(), Lens(np.array([-0.2, 0.05]))])
def test_the_coverage_of_rims_is_their_area(lens: Lens) -> None:
    camera = Camera(176, 144, 220.0, 220.0, 87.5, 71.5, lens)
    strip = STILL.scene.at(0.0).surfaces[0]
    share = strip.cast(np.ascontiguousarray(camera.rays()), pose.identity()).share
    grid = camera.project(strip.grid(50, 200))
    rim = np.concatenate([grid[0], grid[1:, -1], grid[-1, -2::-1], grid[-2::-1, 0]])
    u, v = rim.T
    assert share.sum() == pytest.approx(0.5 * abs(np.dot(u, np.roll(v, -1)) - np.dot(v, np.roll(u, -1))), rel=4e-3)
    assert np.count_nonzero((share > 0) & (share < 1)) > 50


@settings(max_examples=25)
@given(PLACED, st.tuples(*[st.floats(-0.1, 0.1)] * 3))
def test_the_shadow_is_the_region_not_visible_from_the_light(
    strip: PlacedStrip, light: tuple[float, float, float]
) -> None:
    T_rs = pose.from_rotation_vector((0, 0, 0), light)
    share = strip.cast(RAYS, T_rs).share
    dark = strip.shadowed(RAYS * 2.5, np.zeros(3), T_rs)
    certain = (share == 0) | (share == 1)
    np.testing.assert_array_equal(dark[certain], share[certain] == 1)


@pytest.mark.parametrize("lens", ["0", "-0.25,0.06"])
@pytest.mark.parametrize("k", [0, 150, 300])
def test_without_noise_the_truth_is_what_time_of_flight_measures(k: int, lens: str) -> None:
    simulation = build(f"sensors=tof&noise=0&tof=528x432&lens={lens}")
    frames, truth = simulation.expose(k)
    camera = simulation.heads["tof"].camera
    points = truth.points_r[4:-4, 2:-2].reshape(-1, 3)
    u, v = np.floor(camera.project(points) + 0.5).astype(int).T
    away = np.abs(frames[0].si()[v, u] - camera.distance(points))
    assert np.median(away) < 5e-4
    assert np.max(away) < 3e-3


def test_it_is_at_rest_for_a_second_before_the_sag_changes() -> None:
    strip = strip_of(build("seed=3"))
    at_rest = [strip.at(t).grid(3, 31) for t in (0, 0.5, 1.0)]
    assert all(np.array_equal(grid, at_rest[0]) for grid in at_rest)
    placed = [strip.at(k / 30) for k in range(30, 600)]
    steps = np.linalg.norm(np.diff([one.grid(3, 31) for one in placed], axis=0), axis=-1)
    assert 0.001 < steps.max() < 0.012
    sags = np.rad2deg([one.profile.angle[0] - one.profile.angle[-1] for one in placed])
    assert np.ptp(sags) > 5
    gripper = placed[300].T_rg
    np.testing.assert_allclose(gripper[:3, :3] @ gripper[:3, :3].T, np.eye(3), atol=1e-12)
    clamp = placed[300].grid(3, 3001)
    np.testing.assert_allclose(gripper[:3, 3], clamp[1, 0], atol=1e-12)
    np.testing.assert_allclose(gripper[:3, 0], (clamp[1, 1] - clamp[1, 0]) / 1e-4, atol=0.02)
    np.testing.assert_allclose(gripper[:3, 1], (clamp[2, 0] - clamp[0, 0]) / 0.05, atol=1e-9)


def test_with_speed_zero_it_is_static() -> None:
    assert np.array_equal(STILL.expose(0)[1].points_r, STILL.expose(900)[1].points_r)
    sheet = parse("simulated://sheet?speed=0&sensors=tof").build()
    assert np.array_equal(sheet.expose(0)[1].points_r, sheet.expose(900)[1].points_r)
