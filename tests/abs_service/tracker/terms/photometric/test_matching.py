"""Appearance that an image shows beside the mesh is found, and none where several places look alike."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.images import ChannelImage, ColorImage, Image
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.terms.base import Prediction, Term
from abs_service.tracker.terms.linearization import PointLinearization
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.color import ColorTerm
from abs_service.tracker.terms.photometric.illumination import Passive
from abs_service.tracker.terms.photometric.matching import REACH_PX
from abs_service.tracker.terms.places.patches import MAX_PATCHES, SIGMA_PX, SIZE, is_beside, patches_of
from calib.camera import Camera
from calib.noise.images.color import GaussianColor
from calib.noise.images.grey import GaussianGrey
from calib.rig import Sensor
from tests.abs_service.tracker.scenes import as_surface, flat, sheet, sparse

CAMERA = Camera(250, 200, 560.0, 560.0, 124.5, 99.5)
MESH = sheet(12, 14, height=flat, size=(0.2, 0.14))

Print = np.ndarray


def random_print(seed: int = 3) -> Print:
    return np.random.default_rng(seed).integers(0, 256, (CAMERA.height, CAMERA.width, 3)).astype(np.uint8)


def color(picture: Print, mesh: Mesh) -> tuple[Term, Image]:
    noise = GaussianColor(10.0)
    bounds = likelihood.Settings().bounds(Sensor("any", CAMERA, noise))
    column, row = np.floor(CAMERA.project(mesh.vertices) + 0.5).astype(int).T
    return ColorTerm("color", sparse(CAMERA, mesh), picture[row, column].astype(np.float32), noise, bounds), ColorImage(
        picture
    )


def grey(picture: Print, mesh: Mesh) -> tuple[Term, Image]:
    noise = GaussianGrey(10.0)
    bounds = likelihood.Settings().bounds(Sensor("any", CAMERA, noise))
    column, row = np.floor(CAMERA.project(mesh.vertices) + 0.5).astype(int).T
    values = picture[..., 0].astype(np.float32)
    term = ChannelTerm("color", sparse(CAMERA, mesh), values[row, column][:, None], noise, Passive(), bounds)
    return term, ChannelImage(values, np.zeros((1, 1), np.uint8))


def matched(term: Term, image: Image, mesh: Mesh = MESH) -> PointLinearization:
    model = Rigid(mesh)
    seen = term.observe(image, Prediction(as_surface((mesh.vertices, mesh.normals))))
    return seen.match(model.deform(model.rest[None]), model.sparse_jacobian(model.rest), patches_of(mesh))


def moved(image: Image, right: int, down: int) -> Image:
    if isinstance(image, ColorImage):
        return ColorImage(np.roll(image.rgb, (down, right), axis=(0, 1)))
    assert isinstance(image, ChannelImage)
    return ChannelImage(np.roll(image.values, (down, right), axis=(0, 1)), image.channels)


@pytest.mark.parametrize("seen_by", [color, grey])
@settings(max_examples=20, deadline=None)
@given(right=st.integers(-REACH_PX, REACH_PX), down=st.integers(-REACH_PX, REACH_PX))
def test_a_print_is_found_where_it_has_moved_to(seen_by, right, down):
    term, image = seen_by(random_print(), MESH)
    found = matched(term, moved(image, right, down))
    if right == down == 0:  # noise explains it: nobody looks for it
        assert not len(found.residual)
        return
    assert len(found.residual) == 2 * len(MESH.vertices)
    np.testing.assert_allclose(
        found.residual.reshape(-1, 2), np.tile([-right, -down], (len(MESH.vertices), 1)) / SIGMA_PX
    )
    assert is_beside([found]) == (max(abs(right), abs(down)) >= 2)
    # As residuals, they tell where to move: the projection of every vertex, in the places' deviations.
    step = np.array([0.001, -0.002, 0.0015])
    before, after = (CAMERA.project(MESH.vertices + s * step) for s in (0, 1))
    np.testing.assert_allclose((found.rows @ step).reshape(-1, 2), (after - before) / SIGMA_PX, atol=0.02)


@pytest.mark.parametrize("seen_by", [color, grey])
def test_a_blank_or_a_regular_print_is_found_nowhere(seen_by):
    blank = np.full((CAMERA.height, CAMERA.width, 3), 120, np.uint8)
    stripes = blank + (np.arange(CAMERA.width) // 3 % 2 * 60).astype(np.uint8)[:, None]
    for picture in (blank, stripes):
        term, image = seen_by(picture, MESH)
        for right in (0, 2, 3):
            assert not len(matched(term, moved(image, right, 0)).residual)


def test_a_print_that_is_gone_or_outside_the_image_is_found_nowhere():
    term, _ = color(random_print(), MESH)
    other = matched(term, ColorImage(random_print(4)))
    assert not is_beside([other])
    beside = sheet(12, 14, height=flat, size=(0.2, 0.14))
    beside.vertices[:, 0] += 0.3
    term, image = color(random_print(), MESH)
    model = Rigid(beside)
    term = term.observe(image, Prediction(as_surface((beside.vertices, beside.normals))))
    places = term.match(model.deform(model.rest[None]), model.sparse_jacobian(model.rest), patches_of(beside))
    assert not is_beside([places])


@given(st.integers(2, 40), st.integers(2, 40))
def test_patches_cover_the_mesh_and_are_not_too_many(rows, columns):
    mesh = sheet(rows, columns, height=flat)
    patches = patches_of(mesh)
    count = min(max(len(mesh.vertices) // SIZE, 1), MAX_PATCHES)
    np.testing.assert_array_equal(np.unique(patches), np.arange(count))
