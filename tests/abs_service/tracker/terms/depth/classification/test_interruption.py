"""A stripe without return on the object is no end of it; the mesh ends there, and the surface does not."""

import numpy as np
import pytest

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.synthesis.window import WHOLE
from abs_service.tracker.terms.depth.classification.classifier import Classifier
from abs_service.tracker.terms.depth.classification.interruption import interruptions
from abs_service.tracker.terms.depth.classification.visibility import surfaces_of
from abs_service.tracker.terms.depth.outline.first_rim import classified_rim
from abs_service.tracker.terms.depth.outline.rim_classes import RimClass
from tests.abs_service.tracker.terms.depth.outline.outline_scene import BESIDE_M, CAMERA, MESH, moved, picture

RAYS = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
#: Where a ray meets the plane of the sheet, to the right [m]; the mesh ends at 0.15.
RIGHT = RAYS[..., 0] / RAYS[..., 2]
#: Distances of something else to the right of the sheet, as high as the sheet [m].
ASIDE = np.where(np.abs(RAYS[..., 1] / RAYS[..., 2]) < 0.1, 1 / RAYS[..., 2], np.nan).astype(np.float32)


def longer_sheet() -> np.ndarray:
    """The sheet of the mesh and 45 mm more of it on both sides, before a wall [m]."""
    return picture(Mesh(MESH.vertices * (1.3, 1, 1), MESH.faces, MESH.colors, MESH.chart))


def right_side(distance: np.ndarray) -> np.ndarray:
    """Classes of the mesh's vertices at its right end, without the corners'."""
    rim, classes = classified_rim(CAMERA, MESH, moved(MESH, 0.0), distance)
    x, y = MESH.vertices[rim.outer, :2].T
    return classes[(x > 0.14) & (np.abs(y) < 0.09)]


@pytest.mark.parametrize("background", [True, False])
def test_an_edge_at_a_stripe_without_return_beyond_which_the_sheet_goes_on_is_not_free(background):
    striped = longer_sheet()
    if not background:
        striped[striped > BESIDE_M - 0.1] = np.nan
    striped[(RIGHT > 0.153) & (RIGHT < 0.175)] = np.nan
    assert np.all(right_side(striped) == RimClass.OCCLUDED)


@pytest.mark.parametrize("behind", [0.06, -0.2])
def test_an_edge_is_free_if_beyond_the_missing_returns_there_is_something_else(behind):
    """Regression of the opposite: a shadow beside a sheet, and a surface that does not continue it."""
    shadowed = picture()
    shadowed[(RIGHT > 0.153) & (RIGHT < 0.175)] = np.nan
    assert np.all(right_side(shadowed) == RimClass.FREE)
    other = np.where(RIGHT > 0.23, ASIDE + np.float32(behind), shadowed)
    other[(RIGHT > 0.153) & (RIGHT < 0.23)] = np.nan
    assert np.all(right_side(other) == RimClass.FREE)


def test_an_edge_is_free_if_the_surface_beyond_the_missing_returns_is_far_away():
    """More than half the side of a square of the mesh's area."""
    far = np.where(RIGHT > 0.15 + 0.13, ASIDE, picture())
    far[(RIGHT > 0.153) & (RIGHT < 0.15 + 0.13)] = np.nan
    assert np.all(right_side(far) == RimClass.FREE)


def test_a_steep_noisy_surface_is_continued_across_a_stripe_and_a_step_is_not():
    columns = np.arange(120.0)
    steep = np.tile((1 + 0.008 * columns).astype(np.float32), (60, 1))
    noise = 0.005 * np.random.default_rng(2).standard_normal(steep.shape)
    mesh = columns < np.full((60, 1), 60)
    for seen in (steep, (steep + noise).astype(np.float32)):
        seen[:, 60:70] = np.nan
        assert interruptions(surfaces_of(seen), np.isnan(seen), mesh)[:, 60:70].all()
    step = (steep + 0.05 * (columns > 64)).astype(np.float32)
    assert not interruptions(surfaces_of(step), np.isnan(step), mesh).any()


def test_a_stripe_of_the_first_image_is_no_background_of_the_later_ones():
    """A mesh that moves over it is not said to have left the object."""
    striped, expected = longer_sheet(), np.where(np.abs(RIGHT) < 0.15, ASIDE, np.inf).astype(np.float32)
    stripe = (RIGHT > 0.153) & (RIGHT < 0.175) & np.isfinite(ASIDE)
    striped[stripe] = np.nan
    classifier = Classifier(CAMERA)
    first = classifier.classify(striped, expected, WHOLE, striped.shape)
    assert first.hole[stripe].all()
    later = classifier.classify(striped, expected, WHOLE, striped.shape)
    assert not later.free_m[stripe].any()
