"""A missing return is a measurement: what it costs, and which pixels it is about."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.tracker.detection.dropouts import AREA_PX, dropouts
from abs_service.tracker.synthesis import dense
from abs_service.tracker.terms.base import Bounds, Prediction
from abs_service.tracker.terms.depth.classification.outline_distance import inwards
from abs_service.tracker.terms.depth.classification.visibility import classify, surfaces_of
from abs_service.tracker.terms.depth.depth import DepthTerm
from abs_service.tracker.terms.depth.depth_cost import missing_cost
from calib.camera import Camera
from calib.no_return import NEVER, NoReturn
from calib.noise.constant import Constant
from calib.noise.images.color import GaussianColor
from calib.rig import Rig, Sensor
from tests.abs_service.tracker.scenes import as_surface, depth_image, plane_distance, sheet, sparse

CAMERA = Camera(160, 120, 220.0, 220.0, 79.6, 59.7)
SIGMA = 3e-3
INLIER, UNIFORM, OUTLIER = 0.05, 1.6, 4.6
#: Of a plane that is turned by 50° about the vertical axis: z = 1 + SLOPE x.
SLOPE = np.tan(np.radians(50))
MESH = sheet(7, 9, lambda x, y: 1 + SLOPE * x, size=(0.2, 0.2))
SURFACE = as_surface((MESH.vertices, MESH.normals))


def turned() -> np.ndarray:
    """Distances of a large board through the mesh [m]."""
    return plane_distance(CAMERA, np.array([-SLOPE, 0.0, 1.0]), 1.0)


def term(law: NoReturn) -> DepthTerm:
    bounds = Bounds(INLIER, UNIFORM, OUTLIER, law)
    return DepthTerm("tof", sparse(CAMERA, MESH), MESH, Constant(SIGMA), bounds)


def cost_without(law: NoReturn, vertex: int) -> float:
    """Additional cost of the mesh if nothing returns from the pixel of one vertex [nats]."""
    column, row = np.floor(CAMERA.project(MESH.vertices[vertex : vertex + 1])[0] + 0.5).astype(int)
    whole, lost = turned(), turned()
    lost[row, column] = np.nan
    costs = []
    for distance in (whole, lost):
        costs.append(term(law).observe(depth_image(distance), Prediction(SURFACE)).cost(SURFACE)[0])
    return float(costs[1] - costs[0])


@given(st.floats(0.001, 0.999), st.integers(-3, 3), st.floats(0, 5), st.floats(0, 6))
def test_costs_of_missing_returns_are_the_log_odds_of_a_return(share, per_m, grazing, maximum):
    law, center = NoReturn(share, per_m, grazing), np.array([0.1, -0.05, 0.02])
    vertices, normals = (part[0].T.astype(np.float64) for part in (SURFACE.vertices, SURFACE.normals))
    distance = np.linalg.norm(vertices - center, axis=1)
    cosine = np.clip(np.sum(normals * (center - vertices), axis=1) / distance, 0, 1)
    expected = np.clip(-law.log_odds(distance, cosine), 0, maximum)
    np.testing.assert_allclose(missing_cost(law, SURFACE, center, maximum)[0], expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(
    "law", [NoReturn(), NoReturn(0.02, per_m=2.0, grazing=4.0), NoReturn(0.4, per_m=3.0), NEVER], ids=str
)
@pytest.mark.parametrize("vertex", [20, 31, 42])
def test_a_missing_return_costs_as_much_more_as_it_is_less_likely_than_a_return(law, vertex):
    """Between that of a measurement that agrees (half a nat above an exact one) and that of an outlier."""
    point = MESH.vertices[vertex]
    x = np.linalg.norm(point)
    cosine = point @ np.array([-SLOPE, 0, 1]) / np.sqrt(1 + SLOPE**2) / x
    p = law.share * np.exp(law.per_m * (x - 1) + law.grazing * (1 - cosine))
    p /= p + 1 - law.share
    exact = np.log(SIGMA * np.sqrt(2 * np.pi))
    expected = min(max(np.log((1 - p) / p), 0) + 0.5, OUTLIER - INLIER - exact)
    assert cost_without(law, vertex) == pytest.approx(expected, abs=5e-3)


def test_dense_synthesis_weighs_missing_returns_too():
    rig = Rig("r", {"tof": Sensor("tof", CAMERA, GaussianColor())})
    lost = turned()
    lost[40:80:4, 60:100:4] = np.nan
    costs, synthesizer = [], dense.Settings().build(rig, MESH)
    for law in (NoReturn(0.02), NoReturn(0.2)):
        bounds = Bounds(INLIER, UNIFORM, OUTLIER, law)
        seen = DepthTerm("tof", synthesizer, MESH, Constant(SIGMA), bounds)
        costs.append(seen.observe(depth_image(lost), Prediction(SURFACE)).cost(SURFACE)[0])
    expected = synthesizer.view("tof", np.zeros((len(MESH.vertices), 0), np.float32)).render(SURFACE)
    inside = np.isfinite(expected) & np.isnan(lost)
    assert costs[0] - costs[1] == pytest.approx(inside.sum() * np.log((0.98 / 0.02) / (0.8 / 0.2)), rel=0.02)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_dropouts_are_the_missing_pixels_around_which_no_square_of_them_fits(seed):
    generator = np.random.default_rng(seed)
    missing = generator.random((12, 14)) < generator.uniform(0.1, 0.9)
    area = np.zeros_like(missing)
    for row in range(12 - AREA_PX + 1):
        for column in range(14 - AREA_PX + 1):
            square = slice(row, row + AREA_PX), slice(column, column + AREA_PX)
            area[square] |= missing[square].all()
    # Beyond its border, an image may be missing, too.
    np.testing.assert_array_equal(dropouts(missing)[3:-3, 3:-3], (missing & ~area)[3:-3, 3:-3])


def test_the_outline_stays_where_it_is_if_single_returns_are_missing():
    """A third of all returns of a board before a wall, and before nothing."""
    flat = sheet(13, 19, lambda x, y: np.ones_like(x + y))
    surface = as_surface((flat.vertices, flat.normals))
    expected = sparse(CAMERA, flat).view("tof", np.zeros((len(flat.vertices), 0), np.float32)).render(surface)
    generator = np.random.default_rng(1)
    lost = generator.random(expected.shape) < 1 / 3
    for beside in (1.6, np.nan):
        whole = np.where(np.isfinite(expected), expected, beside).astype(np.float32)
        away = []
        for distance in (whole, np.where(lost, np.float32(np.nan), whole)):
            single = dropouts(np.isnan(distance))
            seen = classify(surfaces_of(distance), expected, CAMERA.fx, np.isnan(whole) & ~single, single)
            part, image = inwards(distance, seen, CAMERA.width)
            assert image.shape == whole[part].shape
            away.append(image)
        known = np.isfinite(away[1])
        near = known & (np.abs(away[0]) < 6)
        assert known.mean() > 0.9
        assert np.median(np.abs(away[1] - away[0])[near]) == 0
        assert np.mean(np.abs(away[1] - away[0])[near]) < 0.35
