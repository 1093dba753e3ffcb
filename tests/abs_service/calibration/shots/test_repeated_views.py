"""Shots that repeat a pose of the board count once in a verification, by the shot that most sensors saw."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.calibration.cameras import verification
from abs_service.calibration.files import rig_file
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.report.provenance import Provenance
from evaluation.scenes.boards.board_views import look, random_boards, three_heads

TIMES = 5


def test_a_board_that_is_held_still_does_not_make_a_verification_surer() -> None:
    random = np.random.default_rng(1)
    heads = {name: head for name, head in three_heads().items() if name != "tof"}
    seen = look(heads, random_boards(8, random), random)
    sensors = {
        name: rig_file.SensorCalibration(
            head.camera, residuals=rig_file.Residuals(corners_px=head.corner_sigma * np.sqrt(2))
        )
        for name, head in heads.items()
    }
    known = rig_file.RigCalibration("lab", sensors, Provenance("x", "2026-11-21"))

    def pair(corners: list, planes: list) -> dict:
        report = verification.verify(known, BoardObservations(tuple(corners), tuple(planes)), known.provenance)
        (found,) = report.values["pairs"]
        return found

    once = pair(seen.corners, seen.planes)
    corners, planes = (
        [replace(view, shot=TIMES * view.shot + number) for view in views for number in range(TIMES)]
        for views in (seen.corners, seen.planes)
    )
    # The colour camera did not see the board in the first shot of each pose.
    corners = [view for view in corners if view.sensor == "light" or view.shot % TIMES]
    again = pair(corners, planes)
    assert again["shots"] == once["shots"] == 8
    assert again["sigma_px"] == pytest.approx(once["sigma_px"], rel=1e-3)
