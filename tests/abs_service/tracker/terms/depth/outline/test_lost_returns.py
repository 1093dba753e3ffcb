"""Areas that a sensor loses at the outline, in a shadow or beside one: the object seems to end before them."""

from dataclasses import replace

import numpy as np
import pytest

import abs_service as a
from abs_service.tracker.terms.depth.classification.visibility import classify, surfaces_of
from abs_service.tracker.terms.depth.outline.rim import Rim
from abs_service.tracker.terms.depth.outline.rim_classes import RimClass
from calib.camera import Camera
from tests.abs_service.tracker.terms.depth.outline import outline_scene as scene

CAMERA = Camera(320, 240, 290.0, 290.0, 159.5, 119.5)


def test_edges_that_hang_over_a_lost_area_are_told_from_those_over_a_background():
    view = scene.sparse(scene.CAMERA, scene.MESH).view("tof", np.zeros((len(scene.MESH.vertices), 0), np.float32))
    whole, predicted = scene.picture(), scene.moved(scene.MESH, 0.0)
    on, expected = whole < scene.BESIDE_M - 0.1, view.render(predicted)
    for is_lost in (True, False):
        cut = whole.copy()
        cut[:, np.flatnonzero(on.any(axis=0))[-5] :] = np.nan if is_lost else scene.BESIDE_M
        missing = np.isnan(cut)
        seen = replace(classify(surfaces_of(cut), expected, scene.CAMERA.fx, missing), lost=missing)
        found = scene.begun(whole).observe(cut, seen, expected, predicted).fit(predicted)
        assert found.outside >= 9  # of eleven at the right
        assert found.lost == (found.outside if is_lost else 0)


@pytest.mark.parametrize(
    ("contrast", "has_wall", "expected"),
    [(20, True, "TRACKING"), (0, True, "DEGRADED"), (20, False, "DEGRADED")],
)
def test_a_print_holds_a_sheet_of_which_the_ends_are_lost(contrast: float, has_wall: bool, expected: str):
    """28 mm of it have no return at the right and below, nor has what is beside it: a shadow, and a part of the wall.

    Without a wall it may as well have slid there, by a period of its print.
    """
    generator, rays = np.random.default_rng(0), CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = 0.7 * rays[..., 0] / rays[..., 2], 0.7 * rays[..., 1] / rays[..., 2]
    waves, phases = generator.uniform(-150, 150, (3, 8, 2)), generator.uniform(0, 6, (3, 8))
    paint = np.sin(np.sum(np.stack([x, y], axis=-1)[..., None, None, :] * waves, axis=-1) + phases).sum(axis=-1)
    on, shadow = ((np.abs(x) < 0.15 + by) & (np.abs(y) < 0.1 + by) for by in (0, 0.03))
    background = np.where(shadow | (not has_wall), np.nan, 1.2)
    tracker, found = a.Tracker(CAMERA, a.Nurbs(), color=CAMERA), []
    for k in range(6):
        noise, *levels = generator.standard_normal((4, *x.shape))
        lost = ((x > 0.122) | (y > 0.072)) & (x < 0.25) & (y < 0.2) & (k == 5)
        distance = np.where(lost, np.nan, np.where(on, 0.7 + 0.1 * x**2, background) + 0.001 * noise)
        colors = np.where(on[..., None], 128 + contrast * paint, 30) + 2 * np.stack(levels, axis=-1)
        image = np.clip(colors, 0, 255).astype(np.uint8)
        found.append(tracker.track(distance, time_s=k / 30, mask=on, image=image))
    assert found[-2].status == "TRACKING", found[-2].reasons
    assert found[-1].status == expected, found[-1].reasons


@pytest.mark.parametrize("shadow_px", [3, 5])
def test_the_shadow_of_what_stands_before_the_object_is_no_end_of_it(shadow_px: int):
    """Structured light has no return beside a pole in front of a sheet; on the other side, the sheet ends."""
    shown = scene.picture(replace(scene.MESH, vertices=scene.MESH.vertices * (1.6, 1, 1)))
    rays = scene.CAMERA.unproject(np.ones((scene.CAMERA.height, scene.CAMERA.width)))
    first = int(np.argmax((rays[..., 0] / rays[..., 2])[0] > 0.155))
    shown[:, first : first + shadow_px] = np.nan
    shown[:, first + shadow_px : first + shadow_px + 8] = 0.8
    shown[:, :50][shown[:, :50] < 1.3] = scene.picture()[:, :50][shown[:, :50] < 1.3]
    found = scene.begun(shown).classes
    x = scene.MESH.vertices[Rim.of(scene.MESH).outer, 0]
    assert np.mean(found[x > 0.14] == RimClass.OCCLUDED) > 0.8  # but for the corners
    assert np.mean(found[x < -0.14] == RimClass.FREE) == 1
