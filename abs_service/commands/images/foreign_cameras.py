"""Calibrations as the camera file of `abs-service import`: its own, ours, other programs', bare matrices."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.files import exchange
from abs_service.commands.calibrate.inputs import camera_files
from abs_service.commands.images import open3d_folder
from abs_service.commands.parts import camera_file
from abs_service.commands.parts.camera_file import CameraFile, CameraFileError, ColorTable, DepthTable
from abs_service.config.tables.camera import PoseTable
from calib.camera import Camera
from calib.formats import content
from calib.formats.content import FormatError, Hints
from calib.lenses.lens import Lens

#: Matrices that describe a camera: K alone, or with a column and row of zeros as ScanNet has it.
_SHAPES = ((3, 3), (3, 4), (4, 4))
#: What may stand around a row of numbers: brackets, separators, and the mark with which some editors begin a file.
_AROUND = " \t,;[]\ufeff"


def load(path: Path, size: tuple[int, int], has_color: bool) -> tuple[CameraFile, tuple[str, ...]]:
    """The cameras of a file, and what of it is not taken.

    A file with one camera describes depth and colour images: they are registered to one another.

    Args:
        path: of the file.
        size: width and height of the depth images [px], for files that have none.
        has_color: True if there are colour images.

    Raises:
        CameraFileError, OptionError, ConfigError: the file cannot be read or used.
    """
    text = camera_files.text_of(path)
    if (matrix := _matrix(text)) is not None:
        return _registered(_of_matrix(path, matrix, size), has_color), ()
    if '"intrinsic_matrix"' in text:
        found = open3d_folder.read(path)
        return (found if has_color else found.model_copy(update={"color": None})), ()
    if path.suffix == ".toml" and not re.search(r"^\s*\[sensors\b", text, re.MULTILINE):
        return camera_file.load(path), ()
    if path.suffix == ".json" and '"depth"' in text:
        return camera_file.load(path), ()
    try:
        name = exchange.of_content(path, text)
    except exchange.ExchangeError:
        formats = f"a matrix of 3 × 3 numbers, open3d, {', '.join(exchange.READERS)}, a calibration file of ours"
        raise CameraFileError(
            f"{path}: its format is none of {formats}, and it is no camera file as `abs-service import --help` shows it"
        ) from None
    try:
        read = camera_files.parse(path, text, Hints(size=size), name)
    except exchange.ExchangeError as error:
        raise CameraFileError(
            f"{error}; `abs-service calibrate convert` has more options, and what it writes is a file for --camera"
        ) from None
    return _chosen(path, read.cameras, has_color), read.lost


def _matrix(text: str) -> NDArray[np.float64] | None:
    """The numbers of a file that has nothing but a matrix, in rows or one after the other; None of another file."""
    lines = (line.strip(_AROUND) for line in text.splitlines())
    try:
        matrix = np.array([re.split(r"[\s,;]+", line) for line in lines if line], float)
    except ValueError:
        return None
    if matrix.size == np.prod(_SHAPES[0]):
        return matrix.reshape(_SHAPES[0])
    return matrix if matrix.shape in _SHAPES else None


def _of_matrix(path: Path, matrix: NDArray[np.float64], size: tuple[int, int]) -> Camera:
    try:
        return content.camera(size, content.focal(matrix[:3, :3]), Lens())
    except FormatError as error:
        raise CameraFileError(f"{path}: {error}") from None


def _registered(camera: Camera, has_color: bool) -> CameraFile:
    return CameraFile(
        depth=DepthTable.model_validate(_table(camera)),
        color=ColorTable.model_validate(_table(camera)) if has_color else None,
    )


def _chosen(path: Path, cameras: Mapping[str, Camera], has_color: bool) -> CameraFile:
    """The cameras called depth and color, or the only one."""
    if len(cameras) == 1:
        return _registered(next(iter(cameras.values())), has_color)
    if "depth" not in cameras or (has_color and "color" not in cameras):
        raise CameraFileError(
            f"{path}: has the cameras {', '.join(cameras)}, of which one has to be called depth and one color; "
            f"`abs-service calibrate convert {path.name} named.calibration.toml --rename OLD=depth --rename OLD=color` "
            "writes a file for --camera"
        )
    color = ColorTable.model_validate(_table(cameras["color"])) if has_color else None
    return CameraFile(depth=DepthTable.model_validate(_table(cameras["depth"])), color=color)


def _table(camera: Camera) -> dict[str, object]:
    """The keys of a table that describe a camera."""
    numbers = {key: getattr(camera, key) for key in ("width", "height", "fx", "fy", "cx", "cy")}
    lens = {"lens": tuple(camera.lens.coefficients.tolist()), "lens_model": camera.lens.name}
    return {**numbers, **lens, "T_rs": PoseTable.model_validate(camera.T_rs.tolist())}
