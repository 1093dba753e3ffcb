"""A board that moves alike in all images while their rows are read is named; one that was held still is not."""

import numpy as np
import pytest

from calib.board.views import CornerView
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation.rolling_shutter import motions
from calib.solve.validation.verdict import RADIUS_95, assess
from evaluation.scenes.boards import board_views

TRUE = Camera(640, 480, 536.0, 536.2, 331.0, 236.0, Lens(np.array([-0.28, 0.09, 0.0006, -0.0004, 0.0])))
READOUT_S = 1 / 30


def solved(velocity: tuple[float, float, float], read_along: int = 1, bend: float = 0.0) -> Solution:
    """Solution from boards that move [m/s] while rows (1) or columns (0) are read, each corner as its own does."""
    random, seen = np.random.default_rng(4), []
    described = board_views.board_points()
    made = described.copy()
    made[:, 2] = bend * (described[:, 0] / 0.16 - 1) ** 2
    for shot, T_rb in board_views.random_boards(16, random, 0.7, 1.3, (0.1, 0.7)).items():
        pixels = board_views.projected(TRUE, T_rb, made)
        for _ in range(5):
            later = READOUT_S * (pixels[:, read_along] / (TRUE.width, TRUE.height)[read_along] - 0.5)
            for index, delay in enumerate(later):
                moved = T_rb.copy()
                moved[:3, 3] += np.array(velocity) * delay
                pixels[index] = board_views.projected(TRUE, moved, made[index : index + 1])[0]
        pixels += random.normal(0, 0.05, pixels.shape)
        if np.all((pixels > 0) & (pixels < (639, 479))):
            seen.append(CornerView("color", shot, float(shot), described, pixels, 0.05))
    return calibrate(Task({"color": SensorTask(640, 480)}, seen, (), "color"))


@pytest.mark.parametrize("velocity", [(0.1, 0, 0), (0, 0.1, 0), (0, 0, -0.25)])
def test_a_motion_that_all_images_share_is_named_with_its_size(velocity: tuple[float, float, float]) -> None:
    solution = solved(velocity)
    (found,) = motions(solution, 1.0)
    assert abs(found.size) == pytest.approx(1000 * np.linalg.norm(velocity) * READOUT_S, rel=0.2)
    verdict = assess(solution, 1.0, 1.0).verdict
    assert verdict.startswith("Do not trust it yet: color: its images look as if board or camera moved by ")


def test_an_image_that_was_turned_is_read_column_by_column() -> None:
    assert motions(solved((0, 0, -0.25), read_along=0), 1.0)


@pytest.mark.parametrize("bend", [0.0, 0.0005, 0.002])
def test_a_board_that_was_held_still_did_not_move(bend: float) -> None:
    """A bend stretches the images of tilted boards as a motion does."""
    assert motions(solved((0, 0, 0), bend=bend), 1.0) == []


def test_a_motion_that_hardly_matters_counts_in_how_well_projections_are_known() -> None:
    """It was in no figure: 0.08 px were claimed where errors were 0.3 px."""
    found = assess(solved((0, 0, -0.1)), 1.0, 1.0)
    assert found.trusted
    (small,) = motions(solved((0, 0, -0.1)), 1.0)
    known = RADIUS_95 * np.hypot(found.images["color"].rms, small.effect_px / np.sqrt(2))
    assert f"are known to {known:.2g} px (95 %)" in found.verdict
