"""Published data sets of boards as views, with the published parameters."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.corners.detection import detect
from calib.board.corners.errors import BoardError
from calib.board.target import Charuco, Chessboard, Circles, Target
from calib.board.views import CornerView
from calib.solve.weights import shared

CIRCLES = Circles(10, 10, 0.0254, 0.0127)
CHESSBOARD = Chessboard(9, 6, 0.025)
CHARUCO = Charuco(14, 9, 0.04, 0.03, "5x5_1000")


@dataclass(frozen=True)
class Published:
    """Published parameters of a camera.

    Attributes:
        matrix: fx, fy, cx, cy (4,) [px].
        lens: coefficients as OpenCV orders them.
    """

    matrix: NDArray[np.float64]
    lens: NDArray[np.float64]


def circles(data: Path) -> tuple[list[CornerView], Published]:
    """`calib_rct_circles`: one colour camera on a robot, its intrinsics published without distortion."""
    images = sorted((data / "images").glob("*.png"), key=lambda path: int(path.stem))
    views = views_of("camera", CIRCLES, dict(enumerate(images)))
    return views, Published(np.array([542.324, 543.515, 320.474, 226.039]), np.zeros(5))


def stereo(data: Path) -> list[CornerView]:
    """`calib_opencv_stereo`: two cameras side by side, thirteen pairs."""
    views = []
    for side in ("left", "right"):
        images = {int(path.stem[-2:]): path for path in sorted(data.glob(f"{side}[0-9]*.jpg"))}
        views += views_of(side, CHESSBOARD, images)
    return views


def azure(data: Path) -> tuple[list[CornerView], dict[str, Published]]:
    """`calib_azure_charuco`: ten images in colour, and in shot 100 one in colour and one in infrared."""
    folder = data / "example_files"
    images = {int(path.stem[6:]): path for path in (folder / "calibration").glob("color-*.jpg")}
    pair = folder / "registration"
    views = views_of("color", CHARUCO, dict(sorted(images.items())) | {100: pair / "color-0.jpg"})
    views += views_of("infrared", CHARUCO, {100: pair / "ir-0.png"})
    return views, {"color": _yaml(pair / "calib_color.yml"), "infrared": _yaml(pair / "calib_ir.yml")}


def views_of(sensor: str, target: Target, images: dict[int, Path]) -> list[CornerView]:
    """Views of all images in which the board is found, by number of the shot."""
    views = []
    for shot, path in images.items():
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if image is None:
            raise FileNotFoundError(path)
        try:
            views.append(detect(target, image).view(target, sensor, shot, float(shot)))
        except BoardError as error:
            print(f"{path.name}: {error}")
    return shared(views)


def _yaml(path: Path) -> Published:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    K, lens = storage.getNode("K").mat(), storage.getNode("dist").mat()
    return Published(np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]], np.float64), np.array(lens, np.float64).ravel())
