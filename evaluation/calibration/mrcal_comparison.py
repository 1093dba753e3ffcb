"""Comparison with mrcal on the same corners and model: projections, and the uncertainty that both state."""

import json
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.board.views import CornerView
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

PYTHON = "/usr/bin/python3"
ORACLE = Path(__file__).with_name("mrcal_oracle.py")


@dataclass(frozen=True)
class Compared:
    """Projections where boards were seen, up to a motion of the camera.

    Attributes:
        rms_px: of the residuals, by mrcal.
        differences: between the two (n,) [px].
        own, other: deviations as we and mrcal state them (n,) [px].
    """

    rms_px: float
    differences: NDArray[np.float64]
    own: NDArray[np.float64]
    other: NDArray[np.float64]


def is_installed() -> bool:
    """True if the system's Python has Debian's python3-mrcal."""
    return Path(PYTHON).exists() and _run("-c", "import mrcal").returncode == 0


def compared(views: Sequence[CornerView], size: tuple[int, int], spacing: float) -> Compared:
    """One camera with five coefficients, calibrated by both from views of a chessboard.

    Args:
        views: of one sensor.
        size: of its images [px].
        spacing: of the board's corners [m].

    Raises:
        RuntimeError: mrcal failed.
    """
    name = views[0].sensor
    solution = calibrate(Task({name: SensorTask(*size)}, views, (), name))
    camera = solution.cameras[name]
    distance = float(np.mean(reach(solution, name)))
    ours = image_uncertainty(solution, name, distance)
    points = viewing_directions(camera, grid(camera).reshape(-1, 2)) * distance
    theirs = _ask(_question(solution, name, spacing, points))
    inside = ours.inside.ravel()
    apart = (np.array(theirs["pixels"]) - camera.project(points))[..., None]
    motion = MotionCompensation(camera, points[inside])
    differences = np.linalg.norm(motion.at(points, apart[inside], apart)[inside, :, 0], axis=1)
    return Compared(theirs["rms"], differences, ours.deviations.ravel()[inside], np.array(theirs["deviations"])[inside])


def _run(*arguments: str, text: str = "") -> subprocess.CompletedProcess[str]:
    """Runs the system's Python without our environment."""
    return subprocess.run(
        [PYTHON, "-I", *arguments], check=False, input=text, capture_output=True, text=True, timeout=120
    )


def _ask(question: dict[str, Any]) -> dict[str, Any]:
    done = _run(str(ORACLE), text=json.dumps(question))
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout)


def _question(solution: Solution, name: str, spacing: float, points: NDArray[np.float64]) -> dict[str, Any]:
    """A question to the oracle, which starts at our boards, but with another focal length and no distortion."""
    camera = solution.cameras[name]
    views = list(solution.task.corners)
    boards = [np.concatenate(pose.to_rotation_vector(solution.boards[view.shot])).tolist() for view in views]
    return {
        "size": [camera.width, camera.height],
        "spacing": spacing,
        "intrinsics": [1.02 * camera.fx, 1.02 * camera.fy, camera.cx, camera.cy, 0, 0, 0, 0, 0],
        "boards": boards,
        "observations": _observed(views, spacing).tolist(),
        "points": points.tolist(),
    }


def _observed(views: list[CornerView], spacing: float) -> NDArray[np.float64]:
    """Corners of each view on the board's grid (n, rows, columns, 3), with weight -1 where one is missing."""
    cells = [np.rint(view.points_b[:, :2] / spacing).astype(int) for view in views]
    columns, rows = np.max(np.concatenate(cells), axis=0) + 1
    found = np.full((len(views), rows, columns, 3), -1.0)
    for each, cell, view in zip(found, cells, views, strict=True):
        each[cell[:, 1], cell[:, 0]] = np.column_stack([view.pixels, np.ones(len(cell))])
    return found
