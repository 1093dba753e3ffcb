"""Alignment of an image with the distances: a wrong calibration is told, a right one and what shows nothing are not."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.pairing.images import BAYER_ORDERS, ChannelImage, ColorImage
from abs_service.tracker.detection.image_alignment import alignment_warnings, displacement
from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.detection.plausibility import doubts
from calib import pose
from calib.camera import Camera
from calib.noise.images.color import GaussianColor
from calib.rig import Rig, Sensor
from tests.abs_service.tracker.scenes import sheet

DEPTH = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
COLOR = Camera(640, 480, 600.0, 600.0, 319.5, 239.5, T_rs=pose.from_rotation_vector([0, 0, 0], [0.03, 0.0, 0.0]))


def scene(seed: int = 1) -> tuple[InitialDetection, np.ndarray]:
    """Twelve plates at 1 m before a wall at 1.5 m, as both cameras see them; each has a brightness and a print."""
    generator = np.random.default_rng(seed)
    plates = [np.sort(generator.uniform(low, low + 0.24, 2)) for low in np.linspace(-0.45, 0.2, 4)]
    images = []
    for camera, wall in ((DEPTH, 1.5), (COLOR, 70.0)):
        z, values = 1.0, np.full((camera.height, camera.width), wall)
        row, column = np.mgrid[: camera.height, : camera.width]
        x, y = (column - camera.cx) / camera.fx * z + camera.T_rs[0, 3], (row - camera.cy) / camera.fy * z
        for number, (left, right) in enumerate(plates * 3):
            top = -0.35 + 0.25 * (number // 4)
            inside = (x > left) & (x < right + 0.05) & (y > top) & (y < top + 0.12)
            values[inside] = 1.0 if camera is DEPTH else 110 + 10 * number + 15 * np.sin(200 * x * y)[inside]
        images.append(values)
    distance = (images[0] / DEPTH.rays()[..., 2]).astype(np.float32)
    noisy = images[1] + generator.normal(0, 3, images[1].shape)
    return InitialDetection(distance, DEPTH, 300, distance), np.clip(noisy, 0, 255).astype(np.uint8)


DETECTION, LEVELS = scene()
IMAGE = ColorImage(np.repeat(LEVELS[..., None], 3, axis=2))


def reported(image, camera=COLOR):
    rig = Rig("r", {"cam": Sensor("cam", camera, GaussianColor(3.0))})
    return alignment_warnings(DETECTION, {"cam": image}, rig)


def test_a_right_calibration_raises_no_doubts():
    assert reported(IMAGE) == ()


@pytest.mark.parametrize(
    ("wrong", "scale", "shift"),
    [
        ({"cx": 299.5}, 1.0, (20, 0)),
        ({"cy": 257.5}, 1.0, (0, -18)),
        ({"fx": 666.0, "fy": 666.0}, 0.9, (0, 0)),
        ({"fx": 540.0, "fy": 540.0, "cx": 329.5}, 1.11, (-10, 0)),
    ],
)
def test_what_would_mend_a_wrong_calibration_is_told(wrong, scale, shift):
    found = displacement(DETECTION, IMAGE, replace(COLOR, **wrong))
    assert found is not None
    assert found.scale == pytest.approx(scale, abs=0.025)
    np.testing.assert_allclose(found.shift, shift, atol=4)
    assert 10 < found.px < 30


@pytest.mark.parametrize("order", ["one channel", "grbg"])
def test_grey_images_and_mosaics_tell_as_well(order):
    image = ChannelImage(LEVELS.astype(np.float32), BAYER_ORDERS.get(order, np.zeros((1, 1), np.uint8)))
    assert reported(image) == ()
    found = displacement(DETECTION, image, replace(COLOR, cx=299.5))
    assert found is not None
    assert found.px == pytest.approx(20, abs=3)


@pytest.mark.parametrize("seed", range(4))
def test_an_image_that_shows_nothing_of_the_jumps_tells_nothing(seed):
    noise = np.random.default_rng(seed).integers(0, 255, IMAGE.rgb.shape, np.uint8)
    assert displacement(DETECTION, ColorImage(noise), COLOR) is None
    dark = np.full_like(IMAGE.rgb, 5)
    assert displacement(DETECTION, ColorImage(dark), COLOR) is None
    assert displacement(DETECTION, ColorImage(np.ascontiguousarray(IMAGE.rgb[::-1])), COLOR) is None


@pytest.mark.parametrize("is_grey", [False, True])
def test_a_mirrored_image_is_told(is_grey):
    grey = ChannelImage(LEVELS.astype(np.float32), np.zeros((1, 1), np.uint8))
    right = grey if is_grey else IMAGE
    pixels = right.values if isinstance(right, ChannelImage) else right.rgb
    changed = {"values" if is_grey else "rgb": np.ascontiguousarray(pixels[:, ::-1])}
    (doubt,) = reported(replace(right, **changed))
    assert doubt.endswith("only if left and right are exchanged: is one of the two mirrored?")
    assert reported(right) == ()


def test_distances_without_a_jump_tell_nothing():
    wall = np.full_like(DETECTION.distance, 1.0)
    for distance in (wall, np.full_like(wall, np.nan)):
        assert displacement(InitialDetection(distance, DEPTH, 300, distance), IMAGE, COLOR) is None


def test_the_doubt_names_the_sensor_and_what_would_mend_it():
    rig = Rig("r", {"cam": Sensor("cam", replace(COLOR, cx=299.5), GaussianColor(3.0))})
    (doubt,) = alignment_warnings(DETECTION, {"cam": IMAGE}, rig)
    assert doubt.startswith("the edges in the image of cam lie 20 px beside those in the distances (fx and fy × 1.00, ")
    assert ", cx +20 and cy " in doubt
    assert "would bring them together): is its calibration that of images of this size" in doubt
    assert doubt in doubts(DETECTION, sheet(), {"cam": IMAGE}, rig)
