"""A selected region has the size of an object, or the distances have the wrong unit."""

import numpy as np
import pytest

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.grid_mesh import grid_mesh
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.regions import box, nearest
from abs_service.tracker.detection.segmentation import detect_object
from calib.camera import Camera
from calib.noise.constant import Constant
from calib.noise.structured_light import StructuredLight
from calib.rig import Rig, Sensor
from tests.abs_service.tracker.scenes import depth_image, observation

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
FINE = Camera(128, 96, 120.0, 120.0, 63.5, 47.5)
RIG = Rig("r", {"tof": Sensor("tof", CAMERA, StructuredLight())})
EVERYWHERE = box.Settings((-1e4, -1e4, -1e4), (1e4, 1e4, 1e4)).build()
#: A sheet of 0.33 × 0.33 m and a wall behind it.
SHEET = np.full((48, 64), 2.0, np.float32)
SHEET[10:30, 10:30] = 1.0


def detect(distance: np.ndarray, region=EVERYWHERE):
    return detect_object(observation(tof=depth_image(distance.astype(np.float32))), RIG, "tof", region, 300)


def test_the_object_is_what_the_region_selects():
    seen = detect(SHEET, nearest.Settings().build())
    assert np.nanmax(seen.distance) == 1.0
    np.testing.assert_array_equal(seen.surroundings, SHEET)


@pytest.mark.parametrize("region", [EVERYWHERE, nearest.Settings().build()])
@pytest.mark.parametrize(("scale", "wide"), [(1e-3, r"\d\.\d mm wide"), (1e3, r"\d{4} m wide")])
def test_distances_in_millimetres_or_thousandths_are_noticed_with_every_region(scale, wide, region):
    with pytest.raises(DetectionError, match=rf"would be {wide}: is the depth scale .*sensors\.tof\.depth\.scale"):
        detect(SHEET * scale, region)


def test_an_object_smaller_than_any_is_refused():
    speck = box.Settings((-0.001, -0.001, 0.0), (0.001, 0.001, 5.0)).build()
    with pytest.raises(DetectionError, match=r"the object would be [0-4]\.\d mm wide"):
        detect(np.full((48, 64), 0.02), speck)


def test_an_object_larger_than_any_is_refused():
    with pytest.raises(DetectionError, match=r"the object would be \d\d m wide"):
        detect(np.full((48, 64), 30.0))


def test_a_few_wrong_pixels_do_not_make_an_object_larger():
    distance = SHEET.copy()
    distance[40, :30] = 150.0  # 1 % of the image
    assert detect(distance).points.shape == (48 * 64, 3)


def test_an_image_without_returns_is_left_to_the_region():
    with pytest.raises(DetectionError, match="holds no surface"):
        detect(np.full((48, 64), np.nan))
    assert not DepthView.of(np.full((48, 64), np.nan, np.float32), CAMERA).measured.any()


@pytest.mark.parametrize(("error_m", "factor"), [(4e-3, 1.0), (12e-3, 2.4)])
def test_a_sensor_is_as_noisy_as_its_first_image_if_that_scatters_much_more_than_its_noise_model_says(error_m, factor):
    """Not as noisy as a background that scatters more because it is farther away."""
    generator = np.random.default_rng(1)
    scene, inside = generator.normal(2.0, 0.05, (96, 128)), np.s_[10:86, 12:116]
    scene[inside] = generator.normal(1.0, error_m, (76, 104))
    rig = Rig("r", {"tof": Sensor("tof", FINE, Constant(5e-3))})
    images = observation(tof=depth_image(scene.astype(np.float32)))
    seen = detect_object(images, rig, "tof", nearest.Settings().build(), 300)
    assert seen.noise_scale == pytest.approx(factor, rel=0.1)
    assert seen.deviation == pytest.approx(seen.noise_scale * 5e-3)


@pytest.mark.parametrize(("away_m", "step", "whole"), [(1.0, "auto", True), (3.3, "auto", True), (3.3, 0.04, False)])
def test_noise_and_steps_of_a_sensor_do_not_tear_a_far_surface(away_m, step, whole):
    """A cylinder, in the steps of a structured light camera, whose distances err alike in blocks of pixels."""
    noise, generator = StructuredLight(), np.random.default_rng(1)
    rows, columns = np.indices((96, 128))
    inside = (abs(columns - 64) < 20) & (abs(rows - 48) < 40)
    depth = away_m + 0.1 * away_m * ((columns - 64) / 20) ** 2 / 2
    shared = np.kron(generator.normal(0, noise.noise, (24, 32)), np.ones((4, 4)))
    stepped = noise.step * np.round((1 / depth + shared) / noise.step)
    images = observation(tof=depth_image(np.where(inside, 1 / stepped, np.nan).astype(np.float32)))
    rig = Rig("r", {"tof": Sensor("tof", FINE, noise)})
    seen = detect_object(images, rig, "tof", nearest.Settings(maximum_step_m=step).build(), 300)
    covered = np.count_nonzero(np.isfinite(seen.distance)) / np.count_nonzero(inside)
    vertices = len(grid_mesh(seen).vertices)
    assert (covered > 0.85 and vertices > 220) == whole, (covered, vertices)


@pytest.mark.parametrize(("step", "whole"), [("auto", True), (0.04, False)])
def test_large_pixels_do_not_tear_a_round_surface(step, whole):
    """A dome of 0.6 m at 2 m, before a camera with pixels of 22 mm there."""
    coarse = Camera(128, 106, 91.4, 91.4, 63.5, 52.5)
    rows, columns = np.indices((106, 128))
    aside = np.hypot(columns - 63.5, rows - 52.5) * 2.0 / 91.4
    inside = aside < 0.285
    depth = np.where(inside, 2.3 - np.sqrt(np.maximum(0.3**2 - aside**2, 0)), np.nan).astype(np.float32)
    rig = Rig("r", {"tof": Sensor("tof", coarse, Constant(5e-3))})
    region = nearest.Settings(maximum_step_m=step).build()
    seen = detect_object(observation(tof=depth_image(depth)), rig, "tof", region, 300)
    covered = np.count_nonzero(np.isfinite(seen.distance)) / np.count_nonzero(inside)
    assert (covered > 0.75) == whole, covered


@pytest.mark.parametrize(("noise", "scale", "reported"), [
    (StructuredLight(), 1.0, 1.0), (StructuredLight(), 10.0, 0.1), (StructuredLight(), 0.1, 10.0),
    (Constant(10e-3), 1.0, 1.0), (Constant(10e-3), 10.0, 1.0), (Constant(0.1e-3), 1.0, 1.0),
])  # fmt: skip
def test_a_unit_that_is_ten_times_off_is_told_by_the_scatter_of_structured_light(noise, scale, reported):
    """Distances of 1.2 m with a deviation of 2 mm; they were tracked in the wrong unit without a word."""
    scene = np.random.default_rng(3).normal(1.2, 2e-3, (96, 128)) * scale
    scene[30:60, 30:60] -= 0.2 * scale
    rig = Rig("r", {"tof": Sensor("tof", FINE, noise)})
    seen = detect_object(observation(tof=depth_image(scene.astype(np.float32))), rig, "tof", EVERYWHERE, 300)
    assert seen.fitting_scale == reported
