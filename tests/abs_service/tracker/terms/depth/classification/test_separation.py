"""Flat things on a table: a step of a centimetre ends them where noise and view let it be seen."""

import numpy as np
import pytest

import abs_service as a
from abs_service.tracker.synthesis.window import WHOLE
from abs_service.tracker.terms.depth.classification.classifier import Classifier
from abs_service.tracker.terms.depth.classification.separation import separating_step
from abs_service.tracker.terms.depth.classification.visibility import MAX_STEP_M
from calib.camera import Camera

CAMERA = Camera(160, 120, 140.0, 140.0, 79.5, 59.5)
TABLE_M = 0.7
THING, MESH = np.s_[30:90, 40:120], np.s_[33:87, 43:117]


def scene(height_m: float, noise_m: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Distances of a thing on a table, and the silhouette of its mesh."""
    distance = np.random.default_rng(2).normal(TABLE_M, noise_m, (120, 160)).astype(np.float32)
    distance[THING] -= height_m
    silhouette = np.zeros(distance.shape, np.bool_)
    silhouette[MESH] = True
    return distance, silhouette


@pytest.mark.parametrize(("height_m", "noise_m"), [(0.01, 1e-3), (0.03, 4e-3)])
def test_a_flat_thing_is_separated_by_a_step_of_less_than_its_height(height_m, noise_m):
    assert 3 * noise_m < separating_step(*scene(height_m, noise_m)) < height_m


@pytest.mark.parametrize(("height_m", "noise_m"), [(0.1, 1e-3), (0.0, 1e-3), (0.002, 1e-4), (0.01, 6e-3)])
def test_the_usual_step_is_kept_where_it_separates_or_none_does(height_m, noise_m):
    """A thing that is high enough, none, one that is too flat, and one in too much noise."""
    assert separating_step(*scene(height_m, noise_m)) == MAX_STEP_M


def test_the_usual_step_is_kept_for_a_mesh_out_of_sight():
    assert separating_step(scene(0.01)[0], np.zeros((120, 160), np.bool_)) == MAX_STEP_M


@pytest.mark.parametrize("nearer_m", [0.0, 0.02])  # what jumps farther than the finer agreement is classified as usual
def test_a_table_beside_a_flat_thing_is_not_the_object(nearer_m):
    distance, silhouette = scene(0.01)
    expected = np.where(silhouette, np.float32(TABLE_M - 0.01), np.float32(np.inf))
    classifier = Classifier(CAMERA)
    first = classifier.classify(distance, expected, WHOLE, distance.shape)
    assert first.object[60, 80]
    assert first.free_m[60, 20] > 0
    seen = classifier.classify(distance - np.float32(nearer_m), expected, WHOLE, distance.shape)
    assert seen.object[60, 80]
    assert (seen.free_m[60, 20] > 0) == (nearer_m == 0)


def test_a_flat_thing_that_is_lifted_is_classified_as_others_are():
    distance, silhouette = scene(0.01)
    classifier = Classifier(CAMERA)
    for lifted_m, agreeing_m in ((0.0, 0.0), (0.1, 0.02)):  # farther off than the finer agreement
        distance[THING] -= np.float32(lifted_m)
        expected = np.where(silhouette, distance + np.float32(agreeing_m), np.float32(np.inf))
        seen = classifier.classify(distance, expected, WHOLE, distance.shape)
        assert seen.object[60, 80]
        assert seen.free_m[60, 20] > 0


def test_a_flat_thing_that_slides_on_a_table_is_tracked():
    camera, generator = a.Camera(160, 120, fx=140, fy=140, cx=79.5, cy=59.5), np.random.default_rng(4)
    column, row = np.meshgrid(np.arange(160), np.arange(120))
    tracker = a.Tracker(camera, a.Rigid(), region={"type": "above_plane", "clearance_m": 0.005})
    x = []
    for k in range(8):
        on_it = (abs(column - 70 - k) < 30) & (abs(row - 60) < 22)
        z = np.where(on_it, TABLE_M - 0.01, TABLE_M) + generator.normal(0, 7e-4, on_it.shape)
        estimate = tracker.track(z, time_s=k / 30)
        assert estimate.status == a.Status.TRACKING, estimate.reasons
        x.append(float(np.mean(estimate.vertices[:, 0])))
    moved = (x[-1] - x[0]) / (TABLE_M - 0.01) * 140
    assert moved == pytest.approx(7, abs=0.5)
