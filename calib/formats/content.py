"""Common types of all formats: cameras by name, list of losses, and conversion of numbers to cameras."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from calib import pose
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens, LensError, LensModel
from calib.pose import Pose

#: Displacement of the edge of an image by a skew that is rounding [px].
NO_SKEW_PX = 0.01


class FormatError(ValueError):
    """Invalid text, or a camera that a format cannot express."""


@dataclass(frozen=True)
class Hints:
    """Values that some formats omit.

    Attributes:
        name: of the camera, for a format without names.
        size: width and height [px], for a format without image sizes; None if unknown.
        lens: "brown-conrady" or "fisheye", for a format that leaves it open; "" if unknown.
        pair: text of another file that says where two cameras stand; "" without one.
    """

    name: str = "camera"
    size: tuple[int, int] | None = None
    lens: str = ""
    pair: str = ""


@dataclass(frozen=True)
class Content:
    """Cameras of a text by name, and descriptions of the losses in reading."""

    cameras: Mapping[str, Camera]
    lost: tuple[str, ...] = ()


@dataclass(frozen=True)
class Written:
    """Written text, and descriptions of the losses in writing."""

    text: str
    lost: tuple[str, ...] = ()


def rigid(matrix: ArrayLike) -> Pose:
    """Pose from 3 × 4 or 4 × 4 numbers, in rows or one after the other; the rotation is orthonormalised.

    Raises:
        FormatError: the numbers are not a pose.
    """
    given = np.asarray(matrix, np.float64)
    if given.shape in {(12,), (16,)}:
        given = given.reshape(-1, 4)
    if given.shape not in {(3, 4), (4, 4)}:
        raise FormatError(f"a pose has 4 × 4 numbers, not {given.tolist()}")
    if not np.array_equal(given[3:], np.eye(4)[3:][: len(given) - 3]):
        raise FormatError(f"the last row of a pose is 0 0 0 1, not {given[3].tolist()}: is the matrix transposed?")
    try:
        return pose.from_rotation(given[:3, :3], given[:3, 3])
    except ValueError as error:
        raise FormatError(f"not a pose: {error}") from error


def brown_conrady(coefficients: ArrayLike) -> Lens:
    """Lens from 4, 5, 8, 12 or 14 coefficients of OpenCV.

    Raises:
        FormatError: thin prism or tilted sensor, which are not supported.
    """
    given = np.ravel(np.asarray(coefficients, np.float64))
    if np.any(given[8:]):
        raise FormatError(f"thin prism and tilt, s1 … τy = {given[8:].tolist()}, cannot be expressed by our lenses")
    return _lens(Lens, given[:8])


def fisheye(coefficients: ArrayLike) -> KannalaBrandt:
    """Lens from up to four coefficients of `cv2.fisheye` (equidistant); further ones must be zero.

    Raises:
        FormatError: more than four nonzero coefficients.
    """
    given = np.ravel(np.asarray(coefficients, np.float64))
    if np.any(given[4:]):
        raise FormatError(f"a fisheye has four coefficients, not {given.tolist()}")
    return _lens(KannalaBrandt, given[:4])


def _lens(model: Any, coefficients: Any) -> Any:
    try:
        return model(coefficients)
    except LensError as error:
        raise FormatError(str(error)) from error


def camera(size: Sequence[Any], matrix: Sequence[Any], lens: LensModel, T_rs: Pose | None = None) -> Camera:
    """Camera from (width, height) and (fx, fy, cx, cy).

    Raises:
        FormatError: the numbers are not a camera.
    """
    try:
        width, height = (int(float(number)) for number in size)
        fx, fy, cx, cy = (float(number) for number in matrix)
        return Camera(width, height, fx, fy, cx, cy, lens, pose.identity() if T_rs is None else T_rs)
    except (TypeError, ValueError, OverflowError) as error:
        raise FormatError(f"no camera: {error}") from error


def focal(matrix: ArrayLike) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy of a camera matrix (3, 3).

    Raises:
        FormatError: it is none, or has a skew that moves pixels, which our cameras have not.
    """
    given = np.asarray(matrix, np.float64)
    if given.shape != (3, 3) or not np.allclose(given[[1, 2, 2, 2], [0, 0, 1, 2]], (0, 0, 0, 1)):
        raise FormatError(f"a camera matrix is [[fx, skew, cx], [0, fy, cy], [0, 0, 1]], not {given.tolist()}")
    (fx, skew, cx), (_, fy, cy), _ = given.tolist()
    if abs(skew * cy) > NO_SKEW_PX * abs(fy):
        raise FormatError(
            f"a skew of {skew:g} moves the top of the image by {abs(skew * cy / fy):.2g} px; our cameras have none. "
            "Calibrate without it"
        )
    return fx, fy, cx, cy


def only(cameras: Mapping[str, Camera], what: str) -> tuple[str, Camera]:
    """The only camera, for formats of a single camera.

    Raises:
        FormatError: several cameras; names them.
    """
    if len(cameras) != 1:
        raise FormatError(f"{what} describes one camera; choose one of {', '.join(cameras)}")
    return next(iter(cameras.items()))


def relative(cameras: Mapping[str, Camera]) -> tuple[str, ...]:
    """Losses of a format with poses relative to the first camera."""
    name, first = next(iter(cameras.items()))
    at_origin = np.array_equal(first.T_rs, np.eye(4))
    return () if at_origin else (f"where {name} is in the rig: poses are relative to it",)


def placed(cameras: Mapping[str, Camera]) -> tuple[str, ...]:
    """Losses of a format without poses."""
    return tuple(f"the pose of {name}" for name, one in cameras.items() if not np.array_equal(one.T_rs, np.eye(4)))


def extra(name: str, table: Mapping[str, Any], known: Sequence[str]) -> tuple[str, ...]:
    """Unused keys of a table."""
    unknown = [str(key) for key in table if key not in known]
    return (f"{name}: {', '.join(unknown)}",) if unknown else ()
