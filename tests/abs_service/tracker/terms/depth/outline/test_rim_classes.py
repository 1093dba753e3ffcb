"""Classes of a mesh's rim, and the agreement of its edges with the outline."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.terms.depth.classification.visibility import classify, surfaces_of
from abs_service.tracker.terms.depth.outline.rim import Rim
from abs_service.tracker.terms.depth.outline.rim_classes import RimClass
from abs_service.tracker.terms.depth.outline.rim_cost import MAX_DEVIATIONS
from tests.abs_service.tracker.scenes import flat, sheet, sparse
from tests.abs_service.tracker.terms.depth.outline.outline_scene import (
    BESIDE_M,
    CAMERA,
    MESH,
    begun,
    look,
    moved,
    outline,
    picture,
)


def classes(distance: np.ndarray, mesh: Mesh = MESH) -> dict[RimClass, int]:
    found = begun(distance, mesh).classes
    return {one: int(np.count_nonzero(found == one)) for one in RimClass}


def test_the_rim_is_free_before_a_wall_and_before_no_return():
    empty = picture()
    empty[empty > 1.3] = np.nan
    for distance in (picture(), empty):
        found = classes(distance)
        assert found[RimClass.FREE] == sum(found.values())


def test_an_edge_on_a_table_or_cut_by_a_mask_is_in_contact():
    """The measured surface goes on to the right, where the mesh ends."""
    table = picture()
    rays = CAMERA.unproject(np.ones_like(table))
    right = (rays[..., 0] / rays[..., 2] > 0.1) & (np.abs(rays[..., 1] / rays[..., 2]) < 0.12)
    table[right] = (1.0 / rays[..., 2])[right]
    found = begun(table)
    x = MESH.vertices[Rim.of(MESH).outer, 0]
    assert np.mean(found.classes[x > 0.14] == RimClass.CONTACT) > 0.9  # but for a corner
    assert np.all(found.classes[x < 0.0] == RimClass.FREE)
    here = look(found, table).fit(moved(MESH, 0.0))
    assert here.visible == np.count_nonzero(found.classes == RimClass.FREE)


def test_an_edge_beside_a_notch_of_a_larger_object_is_no_free_edge():
    """The object goes on to the right, but for a notch: the outline is near, and not where the edges point."""
    coarse = sheet(5, 7, flat)
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = rays[..., 0] / rays[..., 2], rays[..., 1] / rays[..., 2]
    goes_on = (x > 0) & (np.abs(y) < 0.1) & ~((x > 0.18) & (y < -0.04))
    seen = np.where(goes_on, 1.0 / rays[..., 2], picture(coarse)).astype(np.float32)
    found = begun(seen, coarse)
    outer = coarse.vertices[Rim.of(coarse).outer]
    right = outer[:, 0] > 0.14
    assert found.classes[right & (outer[:, 1] < -0.04)] == RimClass.FREE  # before the notch
    assert np.all(found.classes[right & (np.abs(outer[:, 1] - 0.025) < 0.03)] == RimClass.CONTACT)
    here = look(found, seen, coarse).fit(moved(coarse, 0.0))
    assert (here.outside, here.inside) == (0, 0)


def test_a_few_free_edges_are_not_used():
    """The object goes on beyond the mesh on all sides; before a notch, four edges would be free."""
    larger = picture(Mesh(MESH.vertices * (1.8, 1.8, 1), MESH.faces, MESH.colors, MESH.chart))
    assert classes(larger)[RimClass.FREE] == 0
    larger[40:53, 90:] = BESIDE_M
    assert classes(larger)[RimClass.FREE] == 0
    larger[24:66, 90:] = BESIDE_M
    assert classes(larger)[RimClass.FREE] >= 8


@pytest.mark.parametrize(("slope", "expected"), [(0.0, RimClass.FREE), (1.0, RimClass.CONTACT)])
def test_the_outline_of_a_side_is_not_that_of_the_top(slope: float, expected: RimClass):
    """Right of the mesh, the object goes on for another 70 mm, as a flat sheet or as a side that recedes."""
    coarse = sheet(5, 7, flat)
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    x, y = rays[..., 0] / rays[..., 2], rays[..., 1] / rays[..., 2]
    z = (1 - 0.16 * slope) / (1 - slope * x)  # on the side, which begins at 0.16 m
    goes_on = (x > 0) & (z * x < 0.22) & (np.abs(y * z) < 0.1)
    found = begun(np.where(goes_on, np.maximum(z, 1.0) / rays[..., 2], picture(coarse)).astype(np.float32), coarse)
    outer = coarse.vertices[Rim.of(coarse).outer]
    middle = np.abs(outer[:, 1]) < 0.03
    assert np.all(found.classes[(outer[:, 0] > 0.14) & middle] == expected)
    assert np.all(found.classes[(outer[:, 0] < -0.14) & middle] == RimClass.FREE)


@pytest.mark.parametrize("beyond", [0.002, 0.012, 0.025])
def test_an_edge_up_to_two_cells_before_an_occluder_is_occluded_until_that_leaves(beyond: float):
    """The sheet goes on to the right, where something is in front of it; the mesh ends a little before that."""
    larger = Mesh(MESH.vertices * (1.3, 1, 1), MESH.faces, MESH.colors, MESH.chart)
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    covered = picture(larger)
    covered[rays[..., 0] / rays[..., 2] > 0.15 + beyond] = 0.8
    found = begun(covered)
    right = MESH.vertices[Rim.of(MESH).outer, 0] > 0.14
    assert np.mean(found.classes[right] == RimClass.OCCLUDED) > 0.8  # but for the corners
    assert not np.any(found.classes[~right] == RimClass.OCCLUDED)
    hidden, seen = (look(found, image).fit(moved(MESH, 0.0)) for image in (covered, picture(larger)))
    assert seen.covered == hidden.covered > 8
    assert hidden.uncovered == 0
    assert seen.uncovered >= 0.9 * hidden.covered  # a corner's own continuation is beside the sheet


def test_an_edge_at_the_border_of_the_image_may_continue_beyond_it():
    wide = sheet(13, 19, flat, (0.62, 0.2))
    found = classes(picture(wide), wide)
    assert found[RimClass.BORDER] >= 2 * 11
    assert found[RimClass.FREE] >= 2 * 15


@pytest.mark.parametrize("blind", [0, 4, 8])
def test_an_edge_before_columns_in_which_nothing_is_measured_is_cut_by_the_border(blind: int):
    """Half of the sheet is to the right of the image, whose last columns, and every other pixel before, are blind."""
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    last = CAMERA.width - 1 - blind
    shift = (rays[..., 0] / rays[..., 2])[0, last] - MESH.vertices[:, 0].max() - 0.008
    cut = replace(MESH, vertices=MESH.vertices + np.array([shift, 0, 0]))
    seen = picture(replace(MESH, vertices=MESH.vertices * (2, 1, 1) + np.array([shift + 0.15, 0, 0])))
    seen[:, last + 1 :] = np.nan
    seen[::2, last] = np.nan
    found = begun(seen, cut)
    right = cut.vertices[Rim.of(cut).outer, 0] > cut.vertices[:, 0].max() - 0.01
    assert np.mean(found.classes[right] == RimClass.BORDER) > 0.8  # but for the corners
    assert not np.any(found.classes[~right] == RimClass.BORDER)


def test_a_sheet_that_is_alone_before_no_return_ends_by_itself_near_the_border_too():
    """A blind border would have cut other things as well."""
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    shift = (rays[..., 0] / rays[..., 2])[0, -6] - MESH.vertices[:, 0].max()
    aside = replace(MESH, vertices=MESH.vertices + np.array([shift, 0, 0]))
    alone = picture(aside)
    alone[alone > 1.3] = np.nan
    assert np.all(begun(alone, aside).classes == RimClass.FREE)


def test_an_edge_up_to_two_cells_before_the_border_is_cut_by_it_until_the_object_comes_into_the_image():
    """Half of the sheet is to the right of the image; the mesh ends a cell before its last column."""
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    end = (rays[..., 0] / rays[..., 2]).max()
    shift = end - MESH.vertices[:, 0].max() - 0.012
    cut, left = (replace(MESH, vertices=MESH.vertices + np.array([by, 0, 0])) for by in (shift, shift - 0.1))
    whole = replace(MESH, vertices=MESH.vertices * (2, 1, 1) + np.array([shift + 0.15, 0, 0]))
    found = begun(picture(whole), cut)
    right = cut.vertices[Rim.of(cut).outer, 0] > end - 0.02
    assert np.mean(found.classes[right] == RimClass.BORDER) > 0.8  # but for the corners
    assert not np.any(found.classes == RimClass.OCCLUDED)
    assert look(found, picture(whole), cut).fit(moved(cut, 0.0)).uncovered == 0
    seen = look(found, picture(whole, -0.1), left).fit(moved(left, 0.0))
    assert seen.uncovered >= 0.8 * seen.covered > 8


def test_the_edge_of_a_body_that_turns_away_is_a_silhouette():
    """A roll: its mesh ends where its surface is seen at a grazing angle."""
    roll = sheet(13, 19, lambda x, y: 1.15 - np.sqrt(0.15**2 - np.clip(x, -0.1495, 0.1495) ** 2) + 0 * y)
    found = begun(picture(), roll).classes
    x = np.abs(roll.vertices[Rim.of(roll).outer, 0])
    assert np.mean(found[x > 0.14] == RimClass.SILHOUETTE) > 0.9


@pytest.mark.parametrize(("rows", "is_free"), [(61, False), (21, True)])
def test_the_few_free_edges_of_a_round_body_are_not_used(rows: int, is_free: bool):
    """A long roll's ends have less than a quarter of the free edges and silhouettes, a short one's more."""
    size = 0.1994, 0.0055 * rows
    roll = sheet(rows, 25, lambda x, y: 1.1 - np.sqrt(0.1**2 - np.clip(x, -0.0997, 0.0997) ** 2) + 0 * y, size)
    view = sparse(CAMERA, roll).view("tof", np.zeros((len(roll.vertices), 0), np.float32))
    shown = view.render(moved(roll, 0.0))
    found = begun(np.where(np.isfinite(shown), shown, BESIDE_M).astype(np.float32), roll).classes
    outer = roll.vertices[Rim.of(roll).outer]
    share = np.mean(found[np.abs(outer[:, 0]) < 0.06] == RimClass.FREE)
    assert share > 0.9 if is_free else share == 0
    sides = (np.abs(outer[:, 0]) > 0.09) & (np.abs(outer[:, 1]) < 0.4 * size[1])
    assert np.all(found[sides] == RimClass.SILHOUETTE)


@pytest.mark.parametrize(
    ("slopes", "expected"),
    [((1.2, 1.2), RimClass.SILHOUETTE), ((1.2, 0.0), RimClass.FREE), ((0.5, 0.5), RimClass.FREE)],
)
def test_the_outline_of_what_bulges_to_all_sides_is_a_silhouette(slopes: tuple[float, float], expected: RimClass):
    """A cushion, a bent sheet, and a nearly flat cushion, of given slopes at their sides."""
    across, down = slopes
    body = sheet(13, 19, lambda x, y: 0.95 + across * x**2 / 0.3 + down * y**2 / 0.2)
    view = sparse(CAMERA, body).view("tof", np.zeros((len(body.vertices), 0), np.float32))
    shown = view.render(moved(body, 0.0))
    found = classes(np.where(np.isfinite(shown), shown, BESIDE_M).astype(np.float32), body)
    assert found[expected] > 0.9 * sum(found.values())


def test_a_sheet_that_hangs_over_the_outline_or_ends_inside_it_is_told():
    found = outline(picture())
    assert (found.fit(moved(MESH, 0.0)).outside, found.fit(moved(MESH, 0.0)).inside) == (0, 0)
    off = found.fit(moved(MESH, 0.03))
    assert off.outside >= 9
    assert off.inside >= 9
    assert off.visible > off.outside + off.inside


def test_a_mesh_that_hangs_over_where_the_image_cut_the_object_has_slid():
    """The object's end came into the image from the right; the mesh, which the image had cut there, did not move."""
    rays = CAMERA.unproject(np.ones((CAMERA.height, CAMERA.width)))
    end = (rays[..., 0] / rays[..., 2]).max()
    shift = end - MESH.vertices[:, 0].max() - 0.012
    cut = replace(MESH, vertices=MESH.vertices + np.array([shift, 0, 0]))
    whole = replace(MESH, vertices=MESH.vertices * (2, 1, 1) + np.array([shift + 0.15, 0, 0]))
    found = begun(picture(whole), cut)
    assert look(found, picture(whole), cut).fit(moved(cut, 0.0)).off_m == 0
    drawn = picture(whole, end - 0.06 - whole.vertices[:, 0].max())
    drawn[:, :30] = picture(whole)[:, :30]  # as if the board were longer
    assert look(found, drawn, cut).fit(moved(cut, 0.0)).off_m == np.inf  # nothing tells how far


def test_the_distance_of_the_edges_from_the_outline_is_told_in_metres():
    """The sheet is 40 mm longer to the right than when the mesh was made; on the other sides, the edges are on it."""
    longer = look(begun(picture()), np.minimum(picture(), picture(by=0.04)))
    here, y = longer.fit(moved(MESH, 0.0)), np.linspace(-0.1, 0.1, 13)[1:-1]
    nearest = np.minimum(0.04, 0.1 - np.abs(y))
    off = nearest > MAX_DEVIATIONS * 0.5 / CAMERA.fx  # beyond the bound of the cost
    assert (here.outside, here.inside) == (0, np.count_nonzero(off))
    assert here.off_m == pytest.approx(nearest[off].sum() / here.visible, rel=0.1)


def test_the_surface_hides_its_own_edge():
    """A sheet that is rolled up: the vertices of the far end lie behind the near one."""
    rolled = replace(MESH, vertices=MESH.vertices * (1.0, 1.0, 1.0) + (MESH.vertices[:, :1] > 0.1) * (0.0, 0.0, 0.05))
    known = begun(picture())
    view = sparse(CAMERA, MESH).view("tof", np.zeros((len(MESH.vertices), 0), np.float32))
    expected = view.render(moved(MESH, 0.0))
    distance = picture()
    seen = known.observe(distance, classify(surfaces_of(distance), expected, CAMERA.fx), expected, moved(rolled, 0.0))
    assert seen.fit(moved(rolled, 0.0)).occluded >= 11
