"""Saved detections of a board, from which a calibration is solved again without images."""

import io
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.shots.corner_extraction import BoardObservations
from calib.board.target import Target
from calib.board.views import CornerView, PlaneView
from calib.files import atomic

#: End of the names of these files, which are NumPy's archives.
SUFFIX = ".corners.npz"

#: Version of the content.
VERSION = 1

#: Largest difference of a point from the board that is described [m].
_SAME_M = 1e-6

_CORNERS, _PLANES = ("points_b", "pixels"), ("pixels", "distances", "sigmas")


class CornerFileError(ValueError):
    """A file of detections that cannot be used; the message names it and why."""


def is_corner_file(path: Path | None) -> bool:
    """True if a source of views is a file of detections."""
    return path is not None and path.name.endswith(SUFFIX)


def path_beside(out: Path) -> Path:
    """Path of the detections that belong to a calibration or recording."""
    return out.with_name(f"{out.name.removesuffix(out.suffix)}{SUFFIX}")


def write(seen: BoardObservations, path: Path) -> None:
    """Writes corners, distances on the board and sizes of images.

    Raises:
        CornerFileError: the file cannot be written.
    """
    arrays: dict[str, Any] = {
        "version": np.array(VERSION),
        "sensors": np.array([*seen.sizes], np.str_),
        "sizes": np.array([*seen.sizes.values()], np.int64).reshape(-1, 2),
        "corner_sigma_px": np.array([view.sigma_px for view in seen.corners], np.float64),
    }
    arrays |= _columns("corner", seen.corners, _CORNERS, [*seen.sizes])
    arrays |= _columns("plane", seen.planes, _PLANES, [*seen.sizes])
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    try:
        atomic.write(path, buffer.getvalue())
    except OSError as error:
        raise CornerFileError(f"{path}: cannot be written: {error.strerror}") from error


def read(path: Path, target: Target) -> BoardObservations:
    """Reads detections of a board.

    Raises:
        CornerFileError: no such file, no file of detections, or of another board.
    """
    seen = read_any(path)
    _require_board(path, target, seen.corners)
    return seen


def read_any(path: Path) -> BoardObservations:
    """Reads detections of any board.

    Raises:
        CornerFileError: no such file, or no file of detections.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except OSError as error:
        raise CornerFileError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, zipfile.BadZipFile) as error:
        raise CornerFileError(f"{path}: is no file of detections: {error}") from error
    if "version" not in arrays or int(arrays["version"]) != VERSION:
        raise CornerFileError(f"{path}: is no file of detections of version {VERSION}")
    try:
        return _observations(arrays)
    except (KeyError, IndexError, ValueError) as error:
        raise CornerFileError(f"{path}: is damaged: {error}") from error


def _columns(
    kind: str, views: Sequence[CornerView | PlaneView], parts: Sequence[str], sensors: Sequence[str]
) -> dict[str, NDArray[Any]]:
    found: dict[str, NDArray[Any]] = {
        f"{kind}_sensor": np.array([sensors.index(view.sensor) for view in views], np.int64),
        f"{kind}_shot": np.array([view.shot for view in views], np.int64),
        f"{kind}_t_s": np.array([view.t_s for view in views], np.float64),
        f"{kind}_count": np.array([len(view.pixels) for view in views], np.int64),
    }
    for part in parts:
        found[f"{kind}_{part}"] = np.concatenate([getattr(view, part) for view in views]) if views else np.zeros(0)
    return found


def _observations(arrays: Mapping[str, NDArray[Any]]) -> BoardObservations:
    if not all((arrays[name] > 0).all() for name in ("corner_sigma_px", "plane_sigmas")):
        raise ValueError("a deviation is not above 0")
    names = [str(name) for name in arrays["sensors"]]
    corners = [
        CornerView(*place, points_b, pixels, float(sigma_px))
        for (place, (points_b, pixels)), sigma_px in zip(
            _rows("corner", arrays, _CORNERS, names), arrays["corner_sigma_px"], strict=True
        )
    ]
    planes = [PlaneView(*place, *parts) for place, parts in _rows("plane", arrays, _PLANES, names)]
    sizes = {name: (int(size[0]), int(size[1])) for name, size in zip(names, arrays["sizes"], strict=True)}
    return BoardObservations(tuple(corners), tuple(planes), {}, sizes)


def _rows(
    kind: str, arrays: Mapping[str, NDArray[Any]], parts: Sequence[str], names: Sequence[str]
) -> list[tuple[tuple[str, int, float], list[NDArray[np.float64]]]]:
    """Sensor, shot and time of every view, with its parts."""
    ends = np.cumsum(arrays[f"{kind}_count"])[:-1]
    for part in parts:
        if not np.isfinite(arrays[f"{kind}_{part}"]).all():
            raise ValueError(f"{kind}_{part} holds values that are no numbers")
    split = [np.split(arrays[f"{kind}_{part}"], ends) for part in parts]
    places = zip(arrays[f"{kind}_sensor"], arrays[f"{kind}_shot"], arrays[f"{kind}_t_s"], strict=True)
    return [
        ((names[int(sensor)], int(shot), float(t_s)), [part[number] for part in split])
        for number, (sensor, shot, t_s) in enumerate(places)
    ]


def _require_board(path: Path, target: Target, views: Sequence[CornerView]) -> None:
    points = target.points()
    for view in views:
        apart = np.linalg.norm(view.points_b[:, None] - points, axis=2).min(axis=1)
        if not float(apart.max()) < _SAME_M:
            raise CornerFileError(
                f"{path}: its corners are not those of the board that is described; if its squares were measured anew, "
                "detect them again"
            )
