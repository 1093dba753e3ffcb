"""Tracking of arrays, from outside."""

import numpy as np
import pytest
from numba.core.event import install_recorder
from scipy.ndimage import gaussian_filter

import abs_service as a
from tests.abs_service.api.scenes import CAMERA, NOISE, Sheet

BENDING = np.linspace(0, 3.0, 7)
AMPLITUDE = np.full((120, 160), 2000, np.uint16)


def follow(tracker, sheets, **arrays):
    """Estimates of the depth images of sheets at 30 Hz; `arrays` makes further arguments from a sheet."""
    return [
        tracker.track(sheet.depth(seed=k), time_s=k / 30, **{name: make(sheet) for name, make in arrays.items()})
        for k, sheet in enumerate(sheets)
    ]


def vertex_error(estimate, sheet):
    """Mean distance [m] of the vertices from where their material points are."""
    return np.linalg.norm(estimate.vertices - sheet.material(estimate.undeformed), axis=1).mean()


def test_a_sheet_is_found_and_its_bending_estimated():
    sheets = [Sheet(curvature) for curvature in BENDING]
    estimates = follow(a.Tracker(depth=CAMERA, model=a.Nurbs(4, 4), noise=NOISE), sheets)
    last = estimates[-1]
    assert {estimate.status for estimate in estimates} == {a.Status.TRACKING}
    assert vertex_error(last, sheets[-1]) < 0.002
    assert np.ptp(last.vertices[:, 2]) > 0.015  # it has bent
    n = len(last.vertices)
    assert (last.theta.shape, last.covariance.shape) == ((48,), (48, 48))
    assert (last.vertices.shape, last.undeformed.shape, last.vertex_covariance.shape) == ((n, 3), (n, 3), (n, 3, 3))
    assert last.faces.shape[1] == 3
    assert last.faces.max() == n - 1
    assert 0.8 < last.residuals["depth"] < 1.3
    assert last.time_s == pytest.approx(6 / 30)
    assert (last.reasons, last.missing, last.mesh_version) == ((), (), 1)
    assert 0.1e-3 < np.sqrt(last.vertex_covariance[:, 2, 2]).mean() < 3e-3


def test_equal_images_give_equal_estimates():
    sheets = [Sheet(curvature) for curvature in BENDING[:3]]
    first, second = (follow(a.Tracker(CAMERA, a.Nurbs(), noise=NOISE), sheets)[-1] for _ in range(2))
    assert np.array_equal(first.theta, second.theta)


def test_a_sensor_that_is_noisier_than_its_noise_model_is_tracked_with_its_own_noise():
    sheets = [Sheet(curvature) for curvature in BENDING]
    estimates = follow(a.Tracker(CAMERA, a.Nurbs(4, 4), noise=a.noise.Constant(0.2e-3)), sheets)
    assert {estimate.status for estimate in estimates} == {a.Status.TRACKING}
    assert vertex_error(estimates[-1], sheets[-1]) < 0.002
    assert 0.8 < estimates[-1].residuals["depth"] < 1.3
    (warning,) = estimates[-1].warnings
    assert warning.startswith(
        "distances scatter by 0.9 mm about flat things as far away as the object, and not by 0.2 mm"
    )


def test_noise_that_neighbours_share_is_learnt_from_frame_to_frame():
    tracker, generator = a.Tracker(CAMERA, a.Nurbs(4, 4), noise=NOISE), np.random.default_rng(4)
    found = []
    for k in range(40):
        shared = gaussian_filter(generator.standard_normal((120, 160)), 8)
        depth = Sheet(2.0).depth(seed=k) + 3e-3 * shared / shared.std()
        found.append(tracker.track(depth.astype(np.float32), time_s=k / 30))
    assert {estimate.status for estimate in found[10:]} == {a.Status.TRACKING}
    assert 2 < np.median([estimate.residuals["depth"] for estimate in found[10:]]) < 5  # health warns of it


@pytest.mark.parametrize("step_m", [0.012, 0.028])
def test_a_sheet_that_moves_fast_when_tracking_begins_is_followed(step_m):
    sheets = [Sheet(2.0, right=k * step_m - 0.08) for k in range(6)]
    tracker = a.Tracker(CAMERA, a.Nurbs(4, 4), noise=NOISE, color=CAMERA)
    found = follow(tracker, sheets, image=lambda sheet: sheet.image(CAMERA))
    moved = [estimate.vertices[:, 0].mean() - found[0].vertices[:, 0].mean() for estimate in found]
    assert {estimate.status for estimate in found} == {a.Status.TRACKING}
    np.testing.assert_allclose(moved, step_m * np.arange(6), atol=1e-3)


def test_nan_zero_and_infinity_mean_no_return():
    first, *others = (
        a.Tracker(CAMERA, a.Rigid(), noise=NOISE).track(holes(value), time_s=0) for value in (np.nan, 0, np.inf)
    )
    assert all(np.array_equal(first.theta, other.theta, equal_nan=True) for other in others)
    assert first.status == "TRACKING"


def holes(value):
    depth = Sheet().depth()
    depth[::5, ::3] = value
    return depth


def test_depth_can_be_radial():
    z, radial = (  # a mesh of which no vertex lies on the border of two pixels, where rounding decides which it reads
        a.Tracker(CAMERA, a.Nurbs(), noise=NOISE, geometry=geometry, vertices=280).track(
            Sheet(2.0).depth(geometry=geometry), time_s=0
        )
        for geometry in ("z", "radial")
    )
    assert np.allclose(z.vertices, radial.vertices, atol=1e-5)


def test_a_mask_chooses_the_object():
    near, far = Sheet(width=0.10, height=0.10, away=0.4, right=-0.06), Sheet(width=0.14, away=0.6, right=0.11)
    depth = np.minimum(near.depth(), far.depth())
    mask = np.isfinite(far.seen(CAMERA)[0])
    chosen = a.Tracker(CAMERA, a.Rigid(), noise=NOISE).track(depth, time_s=0, mask=mask)
    nearest = a.Tracker(CAMERA, a.Rigid(), noise=NOISE).track(depth, time_s=0)
    assert chosen.vertices[:, 2].mean() == pytest.approx(0.6, abs=0.01)
    assert nearest.vertices[:, 2].mean() == pytest.approx(0.4, abs=0.01)


def test_a_mask_counts_only_in_its_frame():
    tracker = a.Tracker(CAMERA, a.Rigid(), noise=NOISE)
    first = tracker.track(Sheet().depth(), time_s=0, mask=np.zeros((120, 160), bool))
    assert first.status == "INITIALIZING"
    assert first.vertices.shape == first.faces.shape == (0, 3)
    assert tracker.track(Sheet().depth(), time_s=0.1).status == "TRACKING"


def test_a_colour_camera_with_a_pose_sees_a_sheet_slide():
    """Depth does not: the sheet fills the image."""
    color = a.Camera(320, 240, fx=300, fy=300, cx=160, cy=120, T_rs=turned(0.1, [0.06, 0.01, 0]))
    sheets = [Sheet(right=0.002 * k, width=1.0, height=0.8) for k in range(6)]
    region = {"type": "seed", "pixel": [80, 60]}  # for `nearest`, what fills the image is the scene
    depth_only = a.Tracker(CAMERA, a.Rigid(), noise=NOISE, region=region)
    both = a.Tracker(CAMERA, a.Rigid(), noise=NOISE, region=region, color=color)
    slid = follow(both, sheets, image=lambda sheet: sheet.image(color))[-1]
    assert (slid.vertices - slid.undeformed)[:, 0].mean() == pytest.approx(0.010, abs=0.001)
    assert set(slid.residuals) == {"depth", "color"}
    assert vertex_error(slid, sheets[-1]) < 0.3 * vertex_error(follow(depth_only, sheets)[-1], sheets[-1])


def turned(angle, translation):
    """Pose of a camera that is turned about the vertical axis [rad] and moved [m]."""
    T_rs = np.eye(4)
    T_rs[:3, :3] = [[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]]
    T_rs[:3, 3] = translation
    return T_rs


def test_a_frame_may_lack_an_image():
    tracker = a.Tracker(CAMERA, a.Rigid(), noise=NOISE, color=CAMERA)
    sheet = Sheet()
    tracker.track(sheet.depth(), time_s=0, image=sheet.image(CAMERA))
    assert tracker.track(sheet.depth(seed=1), time_s=0.1).missing == ("color",)
    assert tracker.track(time_s=0.2, image=sheet.image(CAMERA)).missing == ("depth",)


@pytest.mark.parametrize("noise", [a.noise.Grey(), a.noise.Bayer()])
def test_pictures_may_have_one_channel(noise):
    tracker = a.Tracker(CAMERA, a.Rigid(), noise=NOISE, color=CAMERA, color_noise=noise)
    estimate = follow(tracker, [Sheet(), Sheet()], image=lambda sheet: sheet.image(CAMERA)[..., 0])[-1]
    assert (estimate.status, estimate.missing) == ("TRACKING", ())


def test_noise_may_depend_on_amplitudes_which_may_be_a_texture_too():
    noise = a.noise.TofAmplitude(sigma=(0.0005,), sigma_amplitude=1.0)
    texture = a.noise.Intensity("amplitude", sigma=50)
    tracker = a.Tracker(CAMERA, a.Nurbs(), noise=noise, texture=texture)
    estimate = follow(tracker, [Sheet(), Sheet(0.5)], amplitude=lambda _: AMPLITUDE)[-1]
    assert (estimate.status, set(estimate.residuals)) == ("TRACKING", {"depth", "depth/amplitude"})


def test_a_sensor_may_measure_its_own_sigma():
    tracker = a.Tracker(CAMERA, a.Nurbs(), noise=a.noise.Measured())
    sigma = np.full((120, 160), 0.001)
    assert follow(tracker, [Sheet(), Sheet(0.5)], deviation_m=lambda _: sigma)[-1].status == "TRACKING"


def test_a_lost_object_is_reported_and_found_again():
    tracker = a.Tracker(CAMERA, a.Nurbs(), noise=NOISE, reinitialization={"after_s": 0.1})
    tracker.track(Sheet().depth(), time_s=0)
    lost = tracker.track(np.full((120, 160), np.nan), time_s=0.1)
    assert lost.status == "LOST"
    assert lost.reasons
    assert np.isnan(lost.vertex_covariance).all()
    assert np.isnan(lost.covariance).all()
    assert [tracker.track(Sheet().depth(), time_s=1 + k / 30).status for k in range(3)][-1] == "TRACKING"


def test_the_object_can_be_looked_for_anew():
    tracker = a.Tracker(CAMERA, a.Rigid(), noise=NOISE)
    tracker.track(Sheet().depth(), time_s=0)
    tracker.reinitialize()
    assert tracker.track(Sheet().depth(), time_s=0.1).mesh_version == 2


def test_parts_may_be_tables_of_a_rig_file():
    tracker = a.Tracker(
        CAMERA,
        {"type": "posed", "shape": {"type": "nurbs", "control_points": [3, 3], "degree": 2}},
        noise={"type": "constant", "sigma": 0.001},
        vertices=100,
        region={"type": "box", "lowest": [-1, -1, 0.1], "highest": [1, 1, 0.9]},
        optimizer={"type": "cma_es", "generations": 10},
        priors={"stretch": 0.01},
        budget_evaluations=500,
    )
    estimate = follow(tracker, [Sheet(), Sheet(0.3)])[-1]
    assert estimate.theta.shape == (6 + 27,)
    assert 50 < len(estimate.vertices) < 200
    assert estimate.evaluations <= 500
    assert (
        a.Tracker(CAMERA, a.Posed(a.Nurbs(3, 3, degree=2)), noise=NOISE).track(Sheet().depth(), time_s=0).theta.size
        == 33
    )


def test_a_search_may_be_limited_in_time():
    tracker = a.Tracker(CAMERA, a.Nurbs(6, 6), noise=NOISE, budget_ms=1e-3)
    unlimited = a.Tracker(CAMERA, a.Nurbs(6, 6), noise=NOISE)
    sheets = [Sheet(), Sheet(2.0)]
    assert follow(tracker, sheets)[-1].inlier_share < follow(unlimited, sheets)[-1].inlier_share


@pytest.mark.slow
def test_kernels_can_be_compiled_before_the_first_frame():
    tracker = a.Tracker(CAMERA, a.Rigid(), noise=NOISE)
    tracker.warm_up()
    with install_recorder("numba:compile") as compiled:
        assert tracker.track(Sheet().depth(), time_s=0).status == a.Status.TRACKING
    assert compiled.buffer == []


def test_what_the_tracker_goes_on_with_cannot_be_written_to():
    estimate = a.Tracker(CAMERA, a.Rigid(), noise=NOISE).track(Sheet().depth(), time_s=0)
    with pytest.raises(ValueError, match="read-only"):
        estimate.undeformed[0] = 0
