"""Views that no camera could have seen are counted in the report as well as on the terminal."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from abs_service import cli
from abs_service.calibration.files import corner_file, target_file
from abs_service.calibration.shots.corner_extraction import BoardObservations
from calib.board.target import Chessboard
from calib.solve.start import start
from evaluation.scenes.boards.board_views import COLUMNS, ROWS, SQUARE, Head, look, random_boards, three_heads


@pytest.mark.slow
def test_views_that_are_left_out_stand_in_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(1)
    camera = replace(three_heads()["color"].camera, T_rs=np.eye(4))
    seen = look({"color": Head(camera, 0.1)}, random_boards(16, random), random)
    found = BoardObservations(tuple(seen.corners), (), {}, {"color": (camera.width, camera.height)})
    corner_file.write(found, tmp_path / "x.corners.npz")
    target_file.write(Chessboard(COLUMNS, ROWS, SQUARE), tmp_path / "board.toml")
    possible, shot = start.pose_candidates, seen.corners[3].shot
    monkeypatch.setattr(start, "pose_candidates", lambda c, view: [] if view.shot == shot else possible(c, view))
    out = tmp_path / "y.calibration.toml"
    options = f"--target {tmp_path}/board.toml --out {out}"
    assert cli.main(f"calibrate intrinsics {tmp_path}/x.corners.npz {options}".split()) in {0, 1}
    page = out.with_suffix(".html").read_text(encoding="utf-8")
    assert f"images show a board where its camera could not have seen one; left out: {shot}" in page
