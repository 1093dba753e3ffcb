"""Detections from and to the text of mrcal, `corners.vnl`."""

import fnmatch
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from abs_service.calibration.files.corner_file import CornerFileError
from abs_service.calibration.shots.corner_extraction import BoardObservations
from calib.board.corners import quality
from calib.board.corners.detection import MIN_POINTS
from calib.board.target import Target
from calib.board.views import CornerView
from calib.files import atomic
from calib.formats import vnl
from drivers.image_folder.listing import last_number

SUFFIX = ".vnl"


def is_vnl(path: Path | None) -> bool:
    """True if a source of views is a table of mrcal."""
    return path is not None and path.suffix == SUFFIX


def read(
    path: Path, target: Target, patterns: Mapping[str, str], sizes: Mapping[str, tuple[int, int]]
) -> BoardObservations:
    """Reads the corners of a board, row by row in each picture.

    Args:
        path: of the table.
        target: the board.
        patterns: names of each sensor's pictures, with wildcards; the last number in a name is that of the shot.
            Other pictures are left out.
        sizes: width and height of each sensor's images [px].

    Raises:
        CornerFileError: unreadable, no picture of any sensor, or of another board.
    """
    try:
        pictures = vnl.read(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise CornerFileError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    except vnl.VnlError as error:
        raise CornerFileError(f"{path}: {error}") from error
    seen: list[CornerView] = []
    for name, pixels in pictures.items():
        sensors = [sensor for sensor, pattern in patterns.items() if fnmatch.fnmatch(name, pattern)]
        shot = last_number(Path(name).stem)
        if not sensors:
            continue
        if len(sensors) > 1 or shot is None:
            raise CornerFileError(f"{path}: {name}: must match only one of --images, and have a number")
        there = np.flatnonzero(np.isfinite(pixels).all(axis=1))
        if len(there) < MIN_POINTS:
            continue
        if len(pixels) != len(target.points()):
            raise CornerFileError(f"{path}: {name}: has {len(pixels)} corners, the board {len(target.points())}")
        sigma_px = quality.sigma_px(target, there, pixels[there])
        seen.append(CornerView(sensors[0], shot, float(shot), target.points()[there], pixels[there], sigma_px))
    if not seen:
        shown = ", ".join([*pictures][:3])
        raise CornerFileError(f"{path}: no picture with corners has a name that --images matches; names: {shown} …")
    return BoardObservations(tuple(seen), sizes=dict(sizes))


def write(seen: BoardObservations, target: Target, path: Path) -> None:
    """Writes corners, with SENSOR-SHOT for the names of pictures.

    Raises:
        CornerFileError: the file cannot be written.
    """
    pictures = {}
    for view in seen.corners:
        points = np.full((len(target.points()), 2), np.nan)
        apart = np.linalg.norm(view.points_b[:, None] - target.points(), axis=2)
        points[apart.argmin(axis=1)] = view.pixels
        pictures[f"{view.sensor}-{view.shot:04d}"] = points
    try:
        atomic.write(path, vnl.write(pictures))
    except OSError as error:
        raise CornerFileError(f"{path}: cannot be written: {error.strerror}") from error
