"""A camera that was zoomed, cropped or exchanged since its calibration is named by its own images of a board."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from abs_service.calibration.cameras import report, verification
from abs_service.calibration.files.rig_file import Covariance, RigCalibration
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.report.content import Level, Report
from abs_service.report.provenance import Provenance
from calib.camera import Camera
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from evaluation.scenes.boards.board_views import Head, look, random_boards, three_heads

ORIGIN = Provenance("x", "2026-11-28")
CAMERA = replace(three_heads()["color"].camera, T_rs=np.eye(4))


def seen(camera: Camera, seed: int) -> BoardObservations:
    """Twelve shots of a camera."""
    random = np.random.default_rng(seed)
    return BoardObservations(tuple(look({"color": Head(camera, 0.1)}, random_boards(12, random), random).corners))


@cache
def calibrated() -> RigCalibration:
    solution = calibrate(Task({"color": SensorTask(1280, 720)}, seen(CAMERA, 1).corners, (), "color"))
    return report.calibration("x", ORIGIN, solution, True, {})


def verified(camera: Camera, seed: int = 2) -> Report:
    return verification.verify(calibrated(), seen(camera, seed), ORIGIN)


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_a_camera_that_is_as_it_was_is_good(seed: int) -> None:
    assert verified(CAMERA, seed).level == Level.GOOD


@pytest.mark.parametrize(
    ("change", "focal", "across"),
    [({"fx": 1.02 * CAMERA.fx, "fy": 1.02 * CAMERA.fy}, 0.02, 0.0), ({"cx": CAMERA.cx + 8}, 0.0, 8.0)],
)
def test_another_focal_length_or_principal_point_is_named_though_corners_fit(
    change: dict[str, float], focal: float, across: float
) -> None:
    found = verified(replace(CAMERA, **change))
    (verdict,) = found.verdicts
    assert (verdict.level, verdict.about) == (Level.BAD, "color")
    assert "no longer projects as it was calibrated: its focal length is " in verdict.text
    values = found.values["optics"]["color"]
    assert values["focal"] == pytest.approx(focal, abs=0.005)
    assert values["center_px"][0] == pytest.approx(across, abs=2.0)


def test_nothing_is_said_of_optics_without_stored_deviations() -> None:
    known = replace(calibrated(), covariance=Covariance())
    found = verification.verify(known, seen(replace(CAMERA, fx=1.02 * CAMERA.fx, fy=1.02 * CAMERA.fy), 2), ORIGIN)
    assert found.level == Level.GOOD
    assert "A changed focal length would not show" in found.verdicts[0].text


def test_a_change_that_these_views_cannot_show_is_said_and_a_large_one_is_doubted() -> None:
    (good,) = verified(CAMERA).verdicts
    assert "A focal length changed by less than 1.1% would not show" in good.text
    random = np.random.default_rng(2)
    flat = random_boards(12, random)
    for T_rb in flat.values():
        T_rb[:3, :3] = np.eye(3)
    views = look({"color": Head(CAMERA, 0.1)}, flat, random).corners
    (blind,) = verification.verify(calibrated(), BoardObservations(tuple(views)), ORIGIN).verdicts
    assert (blind.level, blind.about) == (Level.DOUBTFUL, "color")
    assert "could not be compared well enough" in blind.text
    assert blind.advice.startswith("Take more shots, the board tilted")
