"""Free edges beside which the field of view turns out to end."""

import numpy as np

from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.window import WHOLE
from abs_service.tracker.terms.depth.classification.visibility import classify, surfaces_of
from abs_service.tracker.terms.depth.outline.observed_outline import ObservedRimOutline
from abs_service.tracker.terms.depth.outline.rim import Rim
from abs_service.tracker.terms.depth.outline.rim_classes import RimClass
from abs_service.tracker.terms.depth.outline.rim_outline import RimOutline
from tests.abs_service.tracker.scenes import sparse
from tests.abs_service.tracker.terms.depth.outline.outline_scene import CAMERA, MESH, begun, moved, picture

ALONE = np.where(picture() > 1.3, np.nan, picture()).astype(np.float32)
RIGHT = np.flatnonzero(np.isfinite(ALONE).any(axis=0)).max() + 1
OF_A_SIDE = np.count_nonzero(MESH.vertices[Rim.of(MESH).outer, 0] > 0.14)


def look(at: RimOutline, predicted: Surface, beyond: np.ndarray, window=WHOLE) -> ObservedRimOutline:
    """The outline in the next image, when pixels without return (height, width) are known to be beyond the view."""
    view = sparse(CAMERA, MESH).view("tof", np.zeros((len(MESH.vertices), 0), np.float32))
    expected, seen = view.render(predicted)[window], ALONE[window]
    empty, beyond = np.isnan(seen) & ~beyond[window], beyond[window] & np.isnan(seen)
    classes = classify(surfaces_of(seen), expected, CAMERA.fx, empty=empty, beyond=beyond)
    return at.observe(seen, classes, expected, predicted, window)


def columns_from(first: int) -> np.ndarray:
    return np.tile(np.arange(CAMERA.width) >= first, (CAMERA.height, 1))


def test_a_free_edge_at_which_the_view_ends_is_cut_by_it_until_something_returns_there():
    known, here = begun(ALONE), moved(MESH, 0.0)
    all_of_them = len(look(known, here, columns_from(1000)).edges.outer)
    for beyond, cut in ((RIGHT, OF_A_SIDE), (1000, 0)):
        seen = look(known, here, columns_from(beyond))
        assert len(seen.edges.outer) == all_of_them - cut
        assert len(seen.covered.outer) == cut
        assert seen.fit(here).visible == all_of_them - cut


def test_every_vertex_of_the_rim_has_its_class_and_what_is_cut_now_ends_at_a_border():
    known, here, count = begun(ALONE), moved(MESH, 0.0), len(Rim.of(MESH).outer)
    for beyond, cut in ((1000, 0), (RIGHT, OF_A_SIDE)):
        classes = np.frombuffer(look(known, here, columns_from(beyond)).fit(here).classes, np.uint8)
        assert len(classes) == len(MESH.vertices)
        assert np.count_nonzero(classes == 1 + RimClass.BORDER) == cut
        assert np.count_nonzero(classes == 1 + RimClass.FREE) == count - cut
        assert set(np.flatnonzero(classes)) == set(Rim.of(MESH).outer)


def test_it_stays_cut_while_the_mesh_slides_away_from_it_and_where_nothing_is_looked_at():
    known = begun(ALONE)
    assert len(look(known, moved(MESH, -0.03), columns_from(RIGHT)).covered.outer) == OF_A_SIDE
    left = slice(0, CAMERA.height), slice(0, 60)
    assert len(look(known, moved(MESH, -0.03), columns_from(RIGHT), left).covered.outer) == OF_A_SIDE


def test_an_edge_that_the_view_cuts_only_now_is_free_again_later():
    known, there = begun(ALONE), moved(MESH, 0.06)
    first = look(known, there, columns_from(RIGHT + 8))
    assert len(first.covered.outer) >= OF_A_SIDE
    assert not len(look(known, moved(MESH, 0.0), columns_from(RIGHT + 8)).covered.outer)
