"""A surface that comes nearer than a sensor can measure does not end where its returns do."""

import numpy as np
import pytest

from abs_service.tracker.synthesis.window import WHOLE
from abs_service.tracker.terms.depth.classification.classifier import Classifier
from abs_service.tracker.terms.depth.classification.visibility import Visibility
from calib.camera import Camera

CAMERA = Camera(160, 120, 140.0, 140.0, 79.5, 59.5)
RAYS = CAMERA.rays() / CAMERA.rays()[..., 2:]
#: Half the sides of a sheet [m], and what the sensor can measure at least.
HALF_M, MIN_DISTANCE_M = np.array([0.1, 0.2]), 0.5
#: A pixel below the last returns of the sheet that leans towards the camera.
BELOW = 97, 80


def leaning(lean: float, roll: float = 0.0, noise_m: float = 0.0, away_m: float = 0.6) -> np.ndarray:
    """Distances of a sheet, turned in its plane, so far away in its middle, whose lower end leans to the camera [m]."""
    turn = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    lower = np.array([[1, 0, 0], [0, np.cos(lean), np.sin(lean)], [0, -np.sin(lean), np.cos(lean)]])
    axes = lower @ turn
    middle = np.array([0.0, 0.0, away_m])
    depth = (middle @ axes[:, 2]) / (RAYS @ axes[:, 2])
    on = np.all(np.abs((RAYS * depth[..., None] - middle) @ axes[:, :2]) < HALF_M, axis=-1)
    depth = depth + np.random.default_rng(1).normal(0, noise_m, depth.shape)
    return np.where(on, depth * np.linalg.norm(RAYS, axis=-1), np.nan).astype(np.float32)


def cut(distance: np.ndarray) -> np.ndarray:
    return np.where(distance * CAMERA.rays()[..., 2] > MIN_DISTANCE_M, distance, np.nan).astype(np.float32)


def seen(*images: np.ndarray) -> Visibility:
    """The classes of the last image; the mesh ends beside the first one's returns."""
    expected = np.where(np.isfinite(images[0]), images[0], np.inf).astype(np.float32)
    classifier = Classifier(CAMERA)
    return [classifier.classify(image, expected, WHOLE, image.shape) for image in images][-1]


@pytest.mark.parametrize("noise_m", [0.0, 0.001])
@pytest.mark.parametrize("lean", [0.75, 0.9])
def test_where_the_range_ends_the_object_goes_on_unseen(lean, noise_m):
    """A mesh that a sheet carried below that line was held by it, TRACKING, 60 mm off with a σ of 1 mm."""
    whole = leaning(lean, noise_m=noise_m)
    assert np.isfinite(whole[BELOW])
    assert np.isnan(cut(whole)[BELOW])
    for images in ((cut(whole),), (cut(whole), cut(leaning(lean + 0.05, noise_m=noise_m)))):
        found = seen(*images)
        assert found.beyond[BELOW]
        assert found.hole[BELOW]
        assert found.free_m[BELOW] == 0
        assert found.free_m[60, 30] > 0  # its sides are its ends


@pytest.mark.parametrize(("lean", "roll"), [(0.0, 0.0), (0.0, 0.3), (0.9, 0.2), (-0.9, 0.3)])
def test_a_sheet_that_ends_by_itself_ends_there(lean, roll):
    assert not seen(leaning(lean, roll)).beyond.any()


def test_what_is_farther_than_any_camera_has_to_be_ends_by_itself():
    """The near edge of a mat on a table, parallel to the image's rows, has one depth all along as well."""
    assert not seen(leaning(0.9, away_m=0.9)).beyond.any()


def test_nearer_returns_show_that_the_range_goes_on():
    assert not seen(cut(leaning(0.9)), leaning(0.9)).beyond.any()
    assert not seen(cut(leaning(0.9)), leaning(0.9), cut(leaning(0.9))).beyond.any()


def test_an_image_with_hardly_a_return_shows_no_range():
    few = np.full((120, 160), np.nan, np.float32)
    few[60, 70:90] = 0.5
    assert not seen(few).beyond.any()
