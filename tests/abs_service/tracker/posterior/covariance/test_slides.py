"""Boards that move along themselves, and models that cannot."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import abs_service as a
from abs_service.tracker.detection.strip.strip_detection import Strip
from abs_service.tracker.models.gravity import Gravity
from abs_service.tracker.posterior.covariance.slides import SlideObservability, add_held, add_information
from abs_service.tracker.posterior.curvature import Quadratic
from abs_service.tracker.posterior.linearized_cost import LinearizedCost
from abs_service.tracker.posterior.optimum import Optimum
from calib.camera import Camera

CAMERA = Camera(320, 240, 290.0, 290.0, 159.5, 119.5)


@pytest.mark.parametrize(("half_length_m", "expected"), [(1.0, "DEGRADED"), (0.2, "TRACKING")])
def test_a_board_whose_ends_are_out_of_sight_is_held_by_nothing(half_length_m: float, expected: str):
    """It is bent a little, 14 cm wide, and lies askew in the image; its long edges hold it across only."""
    generator, rays = np.random.default_rng(0), CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = 0.7 * rays[..., 0] / rays[..., 2], 0.7 * rays[..., 1] / rays[..., 2]
    along, across = np.cos(0.35) * x + np.sin(0.35) * y, np.cos(0.35) * y - np.sin(0.35) * x
    tracker, found = a.Tracker(CAMERA, a.Nurbs()), []
    for k in range(3):
        noise, frayed = generator.standard_normal((2, *x.shape))
        on = (np.abs(along) < half_length_m) & (np.abs(across) < 0.07 + 0.002 * frayed)
        distance = np.where(on, 0.7 + 0.5 * along**2, 1.2) + 0.001 * noise
        found.append(tracker.track(distance, time_s=k / 30, mask=on).status)
    assert found == [expected] * 3


@pytest.mark.parametrize(("half_length_m", "expected"), [(1.0, "DEGRADED"), (0.2, "TRACKING")])
def test_ends_that_may_be_those_of_the_view_hold_nothing_in_the_first_images(half_length_m: float, expected: str):
    """A board before nothing is drawn along itself from the first image on, beneath the last columns without return."""
    generator, rays = np.random.default_rng(2), CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = 0.7 * rays[..., 0] / rays[..., 2], 0.7 * rays[..., 1] / rays[..., 2]
    tracker, found = a.Tracker(CAMERA, a.Nurbs()), []
    for k in range(6):
        noise, frayed = generator.standard_normal((2, *x.shape))
        on = (np.abs(x - 0.006 * k + 0.001 * frayed) < half_length_m) & (np.abs(y) < 0.07 + 0.001 * frayed)
        on[:, :7] = on[:, -7:] = False
        distance = np.where(on, 0.7 + 0.1 * x**2 + 0.0015 * noise, np.nan)
        found.append(tracker.track(distance, time_s=k / 30, mask=on).status)
    assert found == [expected] * 6


@pytest.mark.parametrize("has_color", [False, True])
def test_an_end_that_comes_into_sight_does_not_hold_a_plain_board_that_has_slid(has_color: bool):
    """It is drawn along itself before nothing by 8 mm a frame. Its end pushes the mesh along, wherever that lies on it.

    The noise of a plain board's image has no counterpart in its appearance, nor has the edge at its end.
    """
    generator, rays = np.random.default_rng(1), CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = 0.7 * rays[..., 0] / rays[..., 2], 0.7 * rays[..., 1] / rays[..., 2]
    tracker, found = a.Tracker(CAMERA, a.Nurbs(), color=CAMERA if has_color else None), []
    for k in range(30):
        noise, frayed, *levels = generator.standard_normal((5, *x.shape))
        on = (x < 0.45 - 0.008 * k) & (np.abs(y) < 0.07 + 0.001 * frayed)
        distance = np.where(on, 0.7 + 0.1 * x**2 + 0.0015 * noise, np.nan)
        paint = np.where(on[..., None], 170, 60) + 2.5 * np.stack(levels, axis=-1)
        image = np.clip(paint, 0, 255).astype(np.uint8) if has_color else None
        found.append(tracker.track(distance, time_s=k / 30, mask=on, image=image).status)
    assert "TRACKING" not in found


@pytest.mark.parametrize("is_grey", [False, True])
def test_a_faint_print_holds_a_board_in_images_that_show_it(is_grey: bool):
    """Its ends are out of sight. It holds the board in noise, but not when that is all that is left of it."""
    generator, rays = np.random.default_rng(5), CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = 0.7 * rays[..., 0] / rays[..., 2], 0.7 * rays[..., 1] / rays[..., 2]
    noise_model = a.noise.Grey() if is_grey else a.noise.Color()
    tracker, found = a.Tracker(CAMERA, a.Nurbs(), color=CAMERA, color_noise=noise_model), []
    for k in range(8):
        noise, frayed, *levels = generator.standard_normal((5, *x.shape))
        on = np.abs(y) < 0.07 + 0.001 * frayed
        distance = np.where(on, 0.7 + 0.1 * x**2, 1.2) + 0.0015 * noise
        faint = 14 * np.sin(2 * np.pi * x / 0.05) if k < 4 else 0.0
        image = np.clip((150 + faint + 8 * np.stack(levels)).transpose(1, 2, 0), 0, 255).astype(np.uint8)
        found.append(tracker.track(distance, time_s=k / 30, mask=on, image=image[..., 0] if is_grey else image).status)
    assert found == ["TRACKING"] * 4 + ["DEGRADED"] * 4


def test_silhouettes_of_a_sheet_that_rolls_up_are_no_ends_that_hold_it():
    """30 cm long and plain, it moves before nothing and bends to 200°: its ends turn away, and the mesh slides."""
    generator, rays = np.random.default_rng(3), CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    u, v = rays[..., 0] / rays[..., 2], rays[..., 1] / rays[..., 2]
    tracker, found = a.Tracker(CAMERA, a.Nurbs()), []
    for k in range(41):
        radius, middle = 0.3 / np.deg2rad(3 + 197 * k / 40), 0.06 * np.sin(k / 12)
        behind = 0.7 + radius  # the axis of a cylinder, whose nearest point on every ray is z (u, v, 1)
        along, square = behind + u * middle, 1 + u**2
        root = along**2 - square * (behind**2 + middle**2 - radius**2)
        z = (along - np.sqrt(np.maximum(root, 0))) / square
        place = radius * np.arctan2(u * z - middle, behind - z)
        on = (root > 0) & (np.abs(place) < 0.15) & (np.abs(v * z) < 0.1)
        distance = np.where(on, z, np.nan) + 0.0015 * generator.standard_normal(z.shape)
        found.append(tracker.track(distance, time_s=k / 30, mask=on).status)
    assert found[:20] == ["TRACKING"] * 20
    assert "TRACKING" not in found[-10:]


@pytest.mark.parametrize("depth_m", [0.12, 0.08])
def test_the_hem_of_an_oval_body_does_not_hold_it_as_it_turns(depth_m: float):
    """It is plain, 32 cm wide and 40 cm high. By depth alone its mesh bends as the body turns, and slides."""
    generator, rays = np.random.default_rng(4), CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    u, v = rays[..., 0] / rays[..., 2], rays[..., 1] / rays[..., 2]
    tracker, found = a.Tracker(CAMERA, a.Nurbs()), []
    for k in range(25):
        cosine, sine = np.cos(0.03 * k), np.sin(0.03 * k)
        across, along = cosine * u + sine, cosine - sine * u  # of a ray, in the body's axes
        square = (across / 0.16) ** 2 + (along / depth_m) ** 2
        middle = 0.9 * (sine * across / 0.16**2 + cosine * along / depth_m**2)
        root = middle**2 - square * (0.9**2 * ((sine / 0.16) ** 2 + (cosine / depth_m) ** 2) - 1)
        z = (middle - np.sqrt(np.maximum(root, 0))) / square
        on = (root > 0) & (np.abs(v * z) < 0.2)
        distance = np.where(on, z, 1.5) + 0.0015 * generator.standard_normal(z.shape)
        found.append(tracker.track(distance, time_s=k / 30, mask=on).status)
    assert "TRACKING" not in found


def test_a_print_that_is_seen_obliquely_holds_a_mat_on_a_table():
    """It lies at 70°: a slide along the table goes along the line of sight for the most part. It is as fine across."""
    generator, rays = np.random.default_rng(0), CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    rays = rays / rays[..., 2:]
    z = 0.8 / (1 - np.tan(np.deg2rad(70)) * np.minimum(-rays[..., 1], 0.2))
    x, y = rays[..., 0] * z, (z - 0.8) / np.sin(np.deg2rad(70))
    on = (np.abs(x) < 0.12) & (np.abs(y) < 0.15)
    print_px = 362 * np.stack([x, y * np.cos(np.deg2rad(70))], axis=-1)[..., None, None, :]
    waves, phases = generator.uniform(-0.35, 0.35, (3, 8, 2)), generator.uniform(0, 6, (3, 8))
    paint = 128 + 20 * np.sin(np.sum(print_px * waves, axis=-1) + phases).sum(axis=-1)
    tracker, found = a.Tracker(CAMERA, a.Nurbs(), color=CAMERA), []
    for k in range(3):
        noise = generator.standard_normal((4, *x.shape))
        image = np.clip(paint + 2 * np.moveaxis(noise[:3], 0, -1), 0, 255).astype(np.uint8)
        distance = z * np.linalg.norm(rays, axis=-1) + 0.001 * noise[3]
        found.append(tracker.track(distance, time_s=k / 30, mask=on, image=image))
    assert [one.status for one in found] == ["TRACKING"] * 3, found[-1].reasons


@pytest.mark.parametrize(("is_free", "expected_m"), [(True, 1.0), (False, 0.0)])
def test_a_strip_whose_gripper_is_fixed_does_not_slide(is_free: bool, expected_m: float):
    """Without any measurement, a free one may be anywhere."""
    at = np.eye(4)
    at[2, 3] = 1.0
    model = Gravity(Strip(at, 0.3, 0.05, np.zeros(65), 0.004), 4, is_free, 100, np.array([0.0, 1.0, 0.0]))
    theta, size = model.rest, len(model.rest)
    nothing = LinearizedCost(theta, Quadratic(theta, np.eye(size)), np.eye(size), [], model.sparse_jacobian(theta))
    optimum = Optimum(theta, model.deform(theta[None]), nothing, [], np.eye(size))
    assert SlideObservability(model).of(optimum).deviation_m == pytest.approx(expected_m)


@given(st.integers(0, 2**32 - 1), st.integers(1, 50), st.booleans())
def test_information_on_rigid_motions_matches_numpy(seed: int, count: int, is_image: bool):
    generator, center, size = np.random.default_rng(seed), np.array([0.1, -0.2, 0.9]), 0.15
    rows, own, places = generator.standard_normal((3, count, 3))
    known, possible = np.zeros((2, 6, 6))
    eye = generator.standard_normal(3) if is_image else np.zeros(0)
    sight = places - eye if is_image else np.zeros((count, 3))
    sight /= np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-9)
    add_information(rows, own, places, eye, center, size, known, possible)
    turns = np.cross(np.eye(3), ((places - center) / size)[:, None])  # turn × place, of every axis
    motions = np.concatenate([np.tile(np.eye(3), (count, 1, 1)), turns], axis=1).transpose(0, 2, 1)
    seen, shown = (np.einsum("mi,mik->mk", each, motions) for each in (rows, own))
    np.testing.assert_allclose(known, (seen.T @ shown + shown.T @ seen) / 2, atol=1e-9)
    weighted = motions * np.linalg.norm(rows, axis=1)[:, None, None]
    in_sight = weighted - np.einsum("mi,mj,mjk->mik", sight, sight, weighted)
    np.testing.assert_allclose(possible, np.einsum("mik,mil->kl", in_sight, in_sight), atol=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(0, 4))
def test_what_holds_each_slide_matches_numpy(seed: int, count: int):
    generator = np.random.default_rng(seed)
    slides, roots = generator.standard_normal((6, 6)), generator.standard_normal((2, count, 6, 6))
    known, feigned = roots @ roots.transpose(0, 1, 3, 2)
    held = np.zeros(6)
    add_held(slides, known, feigned, held)
    along = np.einsum("is,pij,js->ps", slides, known - feigned, slides)
    np.testing.assert_allclose(held, np.maximum(along, 0).sum(axis=0), rtol=1e-9, atol=1e-9)
