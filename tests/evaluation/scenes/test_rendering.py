"""The experiments' renderer against closed forms: planes, rims, mixed pixels, what hides what, a sphere."""

import numpy as np
import pytest

from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from evaluation.scenes.rendering import Renderer
from evaluation.scenes.surfaces import NO_WALL, Sheet, SplineSurface, Wall, knots

CAMERA = Camera(48, 36, 60.0, 60.0, 23.5, 17.5)


def plane(width: float = 0.3, height: float = 0.2, z: float = 1.0, slope: float = 0.0, dense: int = 250) -> np.ndarray:
    """A rectangle around the optical axis, z = z + slope · x."""
    x, y = np.meshgrid(np.linspace(-width / 2, width / 2, dense), np.linspace(-height / 2, height / 2, dense))
    return np.stack([x, y, z + slope * x], axis=-1)


@pytest.mark.parametrize("slope", [0.0, 0.8, -1.5])
def test_distances_of_a_plane_are_those_of_its_pixels_centres(slope: float) -> None:
    seen = Renderer(CAMERA).render(Sheet(plane(2.0, 2.0, slope=slope, dense=900)))
    rays = CAMERA.rays()
    exact = 1 / (rays[..., 2] - slope * rays[..., 0])
    inner = (slice(4, -4), slice(4, -4))
    # The mean of nine sub-pixels is the centre's but for the curvature of 1 / (1 − slope · x).
    assert np.abs(seen.distance - exact)[inner].max() < 1e-3
    assert np.all(seen.share == 1)


def test_single_sub_pixels_are_exact() -> None:
    seen = Renderer(CAMERA, fineness=1).render(Sheet(plane(2.0, 2.0, slope=0.8, dense=900)))
    rays = CAMERA.rays()
    assert seen.distance == pytest.approx(1 / (rays[..., 2] - 0.8 * rays[..., 0]), abs=1e-9)


def test_a_sphere_is_met_within_micrometres() -> None:
    theta, phi = np.meshgrid(np.linspace(0, 0.15, 400), np.linspace(0, 2 * np.pi, 600), indexing="ij")
    radius, center = 0.2, np.array([0.0, 0.0, 1.0])
    ball = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta)], axis=-1)
    camera = Camera(48, 36, 600.0, 600.0, 23.5, 17.5)
    seen = Renderer(camera, fineness=1).render(Sheet(center + radius * ball))
    along = camera.rays() @ center
    exact = along - np.sqrt(along**2 - (1 - radius**2))
    inside = seen.share > 0
    assert inside.sum() > 900
    assert np.abs(seen.distance - exact)[inside].max() < 2e-5


def test_light_falls_with_the_square_of_the_distance_and_the_cosine() -> None:
    seen = Renderer(CAMERA, fineness=1).render(Sheet(plane(2.0, 2.0, z=2.0, dense=900), np.full((2, 2), 0.8)))
    cosine = CAMERA.rays()[..., 2]
    assert seen.light == pytest.approx(0.8 * cosine / (2.0 / cosine) ** 2)


def test_the_covered_area_is_that_of_the_sheet() -> None:
    seen = Renderer(CAMERA, fineness=5).render(Sheet(plane()))
    assert seen.share.sum() == pytest.approx(0.3 * 60 * 0.2 * 60, rel=0.02)


def test_rims_mix_distances_by_their_light_and_colours_by_their_area() -> None:
    sheet = Sheet(plane(), np.full((2, 2), 0.9), np.full((2, 2, 3), 200.0))
    seen = Renderer(CAMERA, Wall(2.0, 0.45, (20.0, 20.0, 20.0))).render(sheet)
    rim = (seen.share > 0.2) & (seen.share < 0.8)
    s = seen.share[rim]
    near, far = s * 0.9, (1 - s) * 0.45 / 4
    cosine = CAMERA.rays()[rim][:, 2]
    assert seen.distance[rim] == pytest.approx((near + 2 * far) / (near + far) / cosine, rel=2e-2)
    assert seen.color[rim][:, 0] == pytest.approx(200 * s + 20 * (1 - s))


def test_the_nearer_sheet_hides_the_farther_in_any_order() -> None:
    near, far = Sheet(plane(0.1, 0.1, 0.8, dense=120)), Sheet(plane(z=1.2))
    renderer = Renderer(CAMERA)
    one, other = renderer.render(near, far), renderer.render(far, near)
    np.testing.assert_array_equal(one.distance, other.distance)
    assert one.distance[17, 23] == pytest.approx(0.8, rel=1e-3)
    assert one.distance[17, 18] == pytest.approx(1.2, rel=2e-2)


def test_nothing_comes_back_from_nothing() -> None:
    seen = Renderer(CAMERA, NO_WALL).render(Sheet(plane()))
    assert np.isnan(seen.distance[0, 0])
    assert seen.light[0, 0] == 0


def test_a_camera_with_a_pose_sees_the_same_from_its_place() -> None:
    T = pose.from_rotation_vector(np.array([0.1, -0.2, 0.3]), np.array([0.05, 0.02, -0.1]))
    moved = Camera(48, 36, 60.0, 60.0, 23.5, 17.5, T_rs=T)
    sheet = plane(slope=0.3)
    one = Renderer(CAMERA).render(Sheet(sheet))
    other = Renderer(moved).render(Sheet(pose.transform(T, sheet)))
    np.testing.assert_allclose(one.distance, other.distance, rtol=1e-9)


def test_print_is_placed_by_the_sheets_own_coordinates() -> None:
    left_dark = np.where(np.arange(3000) < 1500, 0.1, 0.9)[None].repeat(2, axis=0)
    seen = Renderer(CAMERA).render(Sheet(plane(), left_dark))
    row = seen.light[18, 15:33]
    assert row[:9] == pytest.approx(0.1, rel=0.05)
    assert row[9:] == pytest.approx(0.9, rel=0.05)


def test_a_lens_that_distorts_is_refused() -> None:
    with pytest.raises(ValueError, match="pinhole"):
        Renderer(Camera(48, 36, 60.0, 60.0, 23.5, 17.5, Lens(np.array([-0.1, 0, 0, 0, 0]))))


def test_a_spline_surface_is_what_its_definition_says() -> None:
    """Cox–de Boor, eqs. 3 to 5, written out."""
    control = np.random.default_rng(1).normal(size=(4, 5, 3))
    u, w = np.linspace(0, 1, 7), np.linspace(0, 1, 9)
    expected = np.einsum("ai,bj,ijk->abk", cox_de_boor(u, 4, 2), cox_de_boor(w, 5, 2), control)
    np.testing.assert_allclose(SplineSurface((4, 5), 2, u, w).points(control), expected, atol=1e-12)


def test_control_points_are_found_again() -> None:
    control = np.random.default_rng(2).normal(size=(4, 6, 3))
    spline = SplineSurface((4, 6), 2, np.linspace(0, 1, 30), np.linspace(0, 1, 40))
    np.testing.assert_allclose(spline.fit(spline.points(control)), control, atol=1e-9)


def cox_de_boor(at: np.ndarray, count: int, degree: int) -> np.ndarray:
    """Base splines (len(at), count)."""
    eta = knots(count, degree)
    last = np.flatnonzero(eta < 1)[-1]
    spline = [((eta[i] <= at) & (at < eta[i + 1]) | (at == 1) & (i == last)).astype(float) for i in range(len(eta) - 1)]
    for d in range(1, degree + 1):
        spline = [
            ratio(at - eta[i], eta[i + d] - eta[i]) * spline[i]
            + ratio(eta[i + d + 1] - at, eta[i + d + 1] - eta[i + 1]) * spline[i + 1]
            for i in range(len(spline) - 1)
        ]
    return np.stack(spline, axis=1)


def ratio(top: np.ndarray, bottom: float) -> np.ndarray:
    return top / bottom if bottom else np.zeros_like(top)
