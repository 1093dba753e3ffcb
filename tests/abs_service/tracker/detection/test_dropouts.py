"""Objects of which every second or third pixel has no return are found, and what a gap separates stays separate."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from abs_service.tracker.detection.dropouts import fill_gaps, sparse_gaps
from abs_service.tracker.detection.grid_mesh import grid_mesh
from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.detection.regions import nearest
from abs_service.tracker.detection.segmentation import detect_object
from abs_service.tracker.detection.shapes.rectangle_fit import find_sheet
from calib import pose
from tests.abs_service.tracker.detection.test_grid_mesh import RIG, area, placed, rectangle
from tests.abs_service.tracker.scenes import depth_image, observation

Pixels = NDArray[np.bool_]


def by_chance(share: float) -> Callable[[tuple[int, int]], Pixels]:
    return lambda shape: np.random.default_rng(1).random(shape) < share


def rows(shape: tuple[int, int]) -> Pixels:
    return np.arange(shape[0])[:, None] % 2 + np.zeros(shape) > 0


def checks(shape: tuple[int, int]) -> Pixels:
    return np.add.outer(np.arange(shape[0]), np.arange(shape[1])) % 2 > 0


MISSING = {"30 %": by_chance(0.3), "45 %": by_chance(0.45), "rows": rows, "checks": checks}


def detect(distance: NDArray[np.floating]) -> InitialDetection:
    return detect_object(
        observation(tof=depth_image(distance.astype(np.float32))), RIG, "tof", nearest.Settings().build(), 200
    )


@pytest.mark.parametrize("missing", MISSING.values(), ids=MISSING)
@pytest.mark.parametrize("background", [np.nan, 1.6])
def test_the_mesh_is_that_of_all_returns(missing: Callable[[tuple[int, int]], Pixels], background: float) -> None:
    T_ro = placed(turn=0.3, tilt=0.3)
    whole = rectangle(T_ro, background)
    seen = detect(np.where(missing(whole.shape), np.nan, whole))
    mesh, expected = grid_mesh(seen), grid_mesh(detect(whole))
    assert area(mesh) == pytest.approx(area(expected), rel=0.12)
    assert len(mesh.vertices) == pytest.approx(len(expected.vertices), rel=0.25)
    np.testing.assert_allclose(pose.transform(pose.inverse(T_ro), mesh.vertices)[:, 2], 0, atol=5e-4)
    assert not np.isfinite(seen.distance[missing(whole.shape)]).any()  # nothing is made up


@pytest.mark.parametrize("missing", MISSING.values(), ids=MISSING)
def test_a_sheet_is_the_rectangle_of_all_returns(missing: Callable[[tuple[int, int]], Pixels]) -> None:
    whole = rectangle(placed(turn=0.3, tilt=0.3))
    sheet, expected = (find_sheet(detect(one)) for one in (np.where(missing(whole.shape), np.nan, whole), whole))
    np.testing.assert_allclose((sheet.width, sheet.height), (expected.width, expected.height), atol=0.014)  # 3 px
    np.testing.assert_allclose(sheet.T_rp, expected.T_rp, atol=0.03)


@pytest.mark.parametrize("missing", MISSING.values(), ids=MISSING)
def test_gaps_are_within_the_outline(missing: Callable[[tuple[int, int]], Pixels]) -> None:
    inside = np.isfinite(rectangle(placed()))
    known = inside & ~missing(inside.shape)
    gaps = sparse_gaps(known)
    assert not (gaps & known).any()
    assert np.mean(gaps[inside & ~known]) > 0.8
    assert np.mean(inside[gaps]) > 0.98


@pytest.mark.parametrize("width", [1, 2, 3])
def test_what_a_row_without_return_separates_stays_separate(width: int) -> None:
    """As the rim of a thin thing before a background, which sensors often leave out."""
    distance = rectangle(placed(), background=1.02)
    distance[60 : 60 + width] = np.nan
    np.testing.assert_array_equal(fill_gaps(distance), distance)
    distance[60 : 60 + width, 80:] = 1.0
    distance[:, 88 : 88 + width] = np.nan  # and where two of them cross
    np.testing.assert_array_equal(fill_gaps(distance), distance)


def test_gaps_have_a_distance_of_their_neighbours() -> None:
    distance = np.full((20, 20), 1.5, np.float32)
    distance[:, 10:] = 2.0
    distance[1::2] = np.nan
    there = fill_gaps(distance)
    assert np.isfinite(there[:19]).all()
    assert set(there[:19, :9].ravel()) == {1.5}
    assert set(there[:19, 11:].ravel()) == {2.0}
