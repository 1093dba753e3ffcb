"""The simulated hand: ray casting, clearance, and occlusion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.camera import Camera
from drivers.contract.frame import Geometry
from drivers.simulated.address import parse
from drivers.simulated.shapes.capsules import cast_capsules, shadowed_by_capsules
from drivers.simulated.shapes.hand import Hand
from drivers.simulated.simulation import Simulation

RAYS = np.ascontiguousarray(Camera(32, 24, 32.0, 32.0, 15.5, 11.5).rays())
FINE_RAYS = np.ascontiguousarray(Camera(176, 144, 220.0, 220.0, 87.5, 71.5).rays())
NEAR = st.tuples(st.floats(-0.2, 0.2), st.floats(-0.15, 0.15), st.floats(0.7, 1.3))
CAPSULES = st.lists(
    st.builds(
        lambda first, other, radius: (*first, *np.subtract(other, first), radius), NEAR, NEAR, st.floats(0.02, 0.08)
    ),
    min_size=1,
    max_size=4,
).map(np.array)


def build(query: str, scene: str = "sheet") -> Simulation:
    return parse(f"simulated://{scene}?{query}").build()


def hand_of(simulation: Simulation) -> Hand:
    (hand,) = simulation.scene.occluders
    assert isinstance(hand, Hand)
    return hand


def clearance(points: np.ndarray, capsules: np.ndarray) -> np.ndarray:
    """Distance of points (…, 3) from the nearest surface of capsules, negative inside."""
    first, way, radius = capsules[:, :3], capsules[:, 3:6], capsules[:, 6]
    away = points[..., None, :] - first
    s = np.clip((away * way).sum(-1) / np.maximum((way**2).sum(-1), 1e-18), 0, 1)
    return (np.linalg.norm(away - s[..., None] * way, axis=-1) - radius).min(axis=-1)


def march(rays: np.ndarray, capsules: np.ndarray) -> np.ndarray:
    """Distance to the capsules by ray marching (reference); beyond 2 m for a miss."""
    distance = np.zeros(rays.shape[:-1])
    underway = np.ones(distance.shape, bool)
    for _ in range(2000):  # a ray that grazes a capsule takes a thousand small steps
        step = clearance(rays[underway] * distance[underway][:, None], capsules)
        distance[underway] = np.minimum(distance[underway] + step, 3.0)
        underway[underway] = (np.abs(step) > 1e-7) & (distance[underway] < 3.0)
    return distance


@settings(max_examples=25)
@given(CAPSULES)
def test_ray_distances_agree_with_ray_marching(capsules: np.ndarray) -> None:
    share, distance, cosine, part = cast_capsules(RAYS, capsules)
    expected = march(RAYS, capsules)
    seen = (share == 1) & (cosine > 0.2)
    np.testing.assert_allclose(distance[seen], expected[seen], atol=1e-4)
    assert np.all(expected[share == 1] < 2)
    assert np.all(expected[share == 0] > 2)
    assert np.all((part >= 0) == (share > 0))
    points = RAYS * distance[..., None]
    h = 1e-5
    gradients = [clearance(points + step, capsules) - clearance(points - step, capsules) for step in h * np.eye(3)]
    normal = np.stack(gradients, axis=-1) / (2 * h)
    smooth = (share == 1) & (np.abs(np.linalg.norm(normal, axis=-1) - 1) < 1e-6)  # not in a crease of two capsules
    np.testing.assert_allclose(cosine[smooth], -(normal * RAYS).sum(-1)[smooth], atol=2e-3)


@given(st.tuples(st.floats(-0.2, 0.2), st.floats(-0.12, 0.12), st.floats(0.9, 1.3)), st.floats(0.03, 0.1))
def test_the_coverage_of_a_ball_is_its_projected_area(center: tuple[float, float, float], radius: float) -> None:
    share = cast_capsules(FINE_RAYS, np.array([(*center, 0.0, 0.0, 0.0, radius)]))[0]
    away = np.linalg.norm(center)
    # A cone of half angle α about a direction that is θ off the axis cuts an ellipse out of the plane z = 1.
    alpha, theta = np.arcsin(radius / away), np.arccos(center[2] / away)
    area = np.pi * np.sin(alpha) ** 2 * np.cos(alpha) / (np.cos(theta) ** 2 - np.sin(alpha) ** 2) ** 1.5
    assert share.sum() == pytest.approx(area * 220**2, rel=5e-3, abs=1.5)


@given(CAPSULES, st.tuples(*[st.floats(-0.1, 0.1)] * 3))
def test_the_shadow_is_the_region_not_visible_from_the_light(
    capsules: np.ndarray, light: tuple[float, float, float]
) -> None:
    points = np.array(light) + RAYS * 1.8
    relative = capsules - [*light, 0, 0, 0, 0]
    share = cast_capsules(RAYS, relative)[0]
    dark = shadowed_by_capsules(points, np.array(light), relative)
    certain = (share == 0) | (share == 1)
    np.testing.assert_array_equal(dark[certain], share[certain] == 1)


@pytest.mark.parametrize("scene", ["sheet", "board"])
def test_the_hand_is_out_of_view_in_the_first_second(scene: str) -> None:
    heads = "seed=2&sensors=tof,structured_light,color,bayer,ir"
    alone, crossed = build(heads, scene), build(f"{heads}&occluder=hand", scene)
    for k in (0, 15, 30):
        for without, frame in zip(alone.expose(k)[0], crossed.expose(k)[0]):
            np.testing.assert_array_equal(frame.data, without.data)


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_it_occludes_a_quarter_in_the_middle_of_its_pass_without_contact(seed: int) -> None:
    scene = build(f"seed={seed}&occluder=hand").scene
    hand = hand_of(build(f"seed={seed}&occluder=hand"))
    for t in hand.crossings(4):
        moment = scene.at(t)
        assert moment.hidden(moment.surfaces[0].grid(41, 61), np.zeros(3)).mean() == pytest.approx(0.25, abs=0.05)
    for t in np.arange(0, 30, 0.4):
        moment = scene.at(t)
        nearest = moment.surfaces[0].grid(9, 13)[..., 2].min()
        assert 0.03 < nearest - hand.at(t).outline()[..., 2].max() < 0.08
        assert 0.08 < nearest - hand.at(t).T_rh[2, 3] < 0.12


def test_occluded_pixels_are_nearer_and_the_others_unchanged() -> None:
    simulation = build("seed=1&occluder=hand&sensors=tof,structured_light&noise=0&tof=352x288&structured_light=640x480")
    k = round(30 * hand_of(simulation).crossings(1)[0])
    frames, truth = simulation.expose(k)
    points = truth.points_r[1:-1, 1:-1].astype(float)
    for name in ("tof", "structured_light"):
        camera = simulation.heads[name].camera
        (frame,) = [frame for frame in frames if frame.key == (name, "depth")]
        hidden = simulation.scene.at(k / 30).hidden(points, camera.center)
        u, v = np.moveaxis(np.floor(camera.project(points) + 0.5).astype(int), -1, 0)
        expected = camera.distance(points) if frame.geometry == Geometry.RADIAL else points[..., 2]
        nearer = expected - frame.si()[v, u]
        assert np.isfinite(nearer).mean() > 0.7
        # Beside the hand a pixel may see either, or both.
        assert np.nanpercentile(nearer[hidden], 10) > 0.05
        assert np.nanpercentile(np.abs(nearer[~hidden]), 90) < 0.006


def test_every_head_sees_it_and_its_shadow_lies_beside_it() -> None:
    heads = "seed=1&sensors=tof,structured_light,color,bayer,ir&noise=0"
    alone, crossed = build(heads), build(f"{heads}&occluder=hand")
    k = round(30 * hand_of(crossed).crossings(1)[0])
    without, frames = ({frame.key: frame.data for frame in s.expose(k)[0]} for s in (alone, crossed))
    for key, image in frames.items():
        assert 0.04 < np.mean((image != without[key]).reshape(*image.shape[:2], -1).any(axis=-1)) < 0.3
    skin = frames["color", "color"].reshape(-1, 3)
    assert np.mean(np.abs(skin - 255 * np.array([0.78, 0.57, 0.47])).max(axis=1) < 45) > 0.03
    lost = [np.count_nonzero(depth["structured_light", "depth"] == 0) for depth in (without, frames)]
    assert lost[1] > lost[0] + 300


def test_with_speed_zero_it_stays_out_of_view() -> None:
    still = build("speed=0&occluder=hand&sensors=tof").scene
    assert still.at(100.0).occluders[0].outline()[..., 0].min() > 0.5 or (
        still.at(100.0).occluders[0].outline()[..., 0].max() < -0.5
    )
