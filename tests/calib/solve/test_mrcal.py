"""Same corners and model for mrcal and for us: projections, and what both say of their uncertainty."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from calib import pose
from calib.board.views import CornerView
from calib.lenses.lens import Lens
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation.projection_uncertainty import (
    MotionCompensation,
    grid,
    image_uncertainty,
    reach,
    viewing_directions,
)
from evaluation.calibration import published_boards

PYTHON = "/usr/bin/python3"
ORACLE = Path(__file__).with_name("mrcal_oracle.py")


def run_python(*arguments: str, text: str = "") -> subprocess.CompletedProcess[str]:
    """Runs the system's Python without our environment."""
    return subprocess.run(
        [PYTHON, "-I", *arguments], check=False, input=text, capture_output=True, text=True, timeout=120
    )


@pytest.fixture(scope="module")
def oracle() -> Callable[[dict[str, Any]], dict[str, Any]]:
    """mrcal; skips where it is not installed."""
    if not Path(PYTHON).exists() or run_python("-c", "import mrcal").returncode:
        pytest.skip("needs Debian's python3-mrcal")

    def ask(question: dict[str, Any]) -> dict[str, Any]:
        done = run_python(str(ORACLE), text=json.dumps(question))
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return ask


def observed(views: list[CornerView], spacing: float) -> NDArray[np.float64]:
    """Corners of each view on the board's grid (n, rows, columns, 3), with weight -1 where one is missing."""
    cells = [np.rint(view.points_b[:, :2] / spacing).astype(int) for view in views]
    columns, rows = np.max(np.concatenate(cells), axis=0) + 1
    found = np.full((len(views), rows, columns, 3), -1.0)
    for each, cell, view in zip(found, cells, views, strict=True):
        each[cell[:, 1], cell[:, 0]] = np.column_stack([view.pixels, np.ones(len(cell))])
    return found


def question(solution: Solution, spacing: float, points: NDArray[np.float64]) -> dict[str, Any]:
    """A question to the oracle, which starts at our boards, but with another focal length and no distortion."""
    camera = solution.cameras["left"]
    views = list(solution.task.corners)
    boards = [np.concatenate(pose.to_rotation_vector(solution.boards[view.shot])).tolist() for view in views]
    return {
        "size": [camera.width, camera.height],
        "spacing": spacing,
        "intrinsics": [1.02 * camera.fx, 1.02 * camera.fy, camera.cx, camera.cy, 0, 0, 0, 0, 0],
        "boards": boards,
        "observations": observed(views, spacing).tolist(),
        "points": points.tolist(),
    }


@pytest.mark.slow
def test_projections_are_those_of_mrcal_within_what_both_say(
    data_set: Callable[[str], Path], oracle: Callable[[dict[str, Any]], dict[str, Any]]
) -> None:
    """Thirteen views of a real camera, compared where boards were seen and up to a motion of the camera."""
    views = [view for view in published_boards.stereo(data_set("calib_opencv_stereo")) if view.sensor == "left"]
    solution = calibrate(Task({"left": SensorTask(640, 480)}, views, (), "left"))
    camera = solution.cameras["left"]
    assert isinstance(camera.lens, Lens)
    distance = float(np.mean(reach(solution, "left")))
    ours = image_uncertainty(solution, "left", distance)
    points = viewing_directions(camera, grid(camera).reshape(-1, 2)) * distance
    theirs = oracle(question(solution, published_boards.CHESSBOARD.square, points))
    inside = ours.inside.ravel()
    apart = (np.array(theirs["pixels"]) - camera.project(points))[..., None]
    motion = MotionCompensation(camera, points[inside])
    differences = np.linalg.norm(motion.at(points, apart[inside], apart)[inside, :, 0], axis=1)
    own, other = ours.deviations.ravel()[inside], np.array(theirs["deviations"])[inside]
    print(f"rms {theirs['rms']:.3f} px, difference {np.median(differences):.4f}, {differences.max():.4f} px")
    print(f"deviation: ours {np.median(own):.4f} px, mrcal's {np.median(other):.4f} px")
    assert np.median(differences / np.hypot(own, other)) < 1
    assert np.all(differences < 3 * np.hypot(own, other))
    assert np.median(own) > np.median(other), "ours allows for errors that the corners of a view have in common"
