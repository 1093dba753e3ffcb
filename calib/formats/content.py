"""What all formats have in common: cameras by name, what got lost, and numbers that make them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from calib import pose
from calib.camera import Camera
from calib.fisheye import KannalaBrandt
from calib.lens import Lens, LensError, LensModel
from calib.pose import Pose


class FormatError(ValueError):
    """A text that is not of its format, or a camera that a format cannot express."""


@dataclass(frozen=True)
class Hints:
    """What some formats leave open.

    Attributes:
        name: of the camera where the text has only one and no name for it.
        size: width and height [px] where the text has none; None if nobody knows.
        unit: length of the unit of translations where the format does not fix it [m].
    """

    name: str = "camera"
    size: tuple[int, int] | None = None
    unit: float = 1.0


@dataclass(frozen=True)
class Content:
    """Cameras that a text describes, by name, and what else it says that has no place in them, in words."""

    cameras: Mapping[str, Camera]
    lost: tuple[str, ...] = ()


@dataclass(frozen=True)
class Written:
    """A text, and what it does not say of the cameras, in words."""

    text: str
    lost: tuple[str, ...] = ()


def rigid(matrix: ArrayLike) -> Pose:
    """The pose of 3 × 4 or 4 × 4 numbers; a rotation that was rounded is made orthonormal again.

    Raises:
        FormatError: they are no pose.
    """
    given = np.asarray(matrix, np.float64)
    if given.shape not in {(3, 4), (4, 4)}:
        raise FormatError(f"a pose has 4 × 4 numbers, not {given.tolist()}")
    try:
        return pose.from_rotation(given[:3, :3], given[:3, 3])
    except ValueError as error:
        raise FormatError(f"not a pose: {error}") from error


def brown_conrady(coefficients: ArrayLike) -> Lens:
    """The lens of 4, 5, 8, 12 or 14 coefficients of OpenCV.

    Raises:
        FormatError: thin prism or tilted sensor, which have no place here.
    """
    given = np.ravel(np.asarray(coefficients, np.float64))
    if np.any(given[8:]):
        raise FormatError(f"thin prism and tilt, s1 … τy = {given[8:].tolist()}, cannot be expressed by our lenses")
    return _lens(Lens, given[:8])


def fisheye(coefficients: ArrayLike) -> KannalaBrandt:
    """The lens of up to four coefficients of `cv2.fisheye`, which others call equidistant; further ones must be zero.

    Raises:
        FormatError: they are not.
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
    """A camera of (width, height) and (fx, fy, cx, cy).

    Raises:
        FormatError: the numbers describe none.
    """
    try:
        width, height = (int(float(number)) for number in size)
        fx, fy, cx, cy = (float(number) for number in matrix)
        return Camera(width, height, fx, fy, cx, cy, lens, pose.identity() if T_rs is None else T_rs)
    except (TypeError, ValueError, OverflowError) as error:
        raise FormatError(f"no camera: {error}") from error


def only(cameras: Mapping[str, Camera], what: str) -> tuple[str, Camera]:
    """The one camera that a format has room for.

    Raises:
        FormatError: there are several; names them.
    """
    if len(cameras) != 1:
        raise FormatError(f"{what} describes one camera; choose one of {', '.join(cameras)}")
    return next(iter(cameras.items()))


def relative(cameras: Mapping[str, Camera]) -> tuple[str, ...]:
    """What gets lost where poses are relative to the first camera."""
    name, first = next(iter(cameras.items()))
    at_origin = np.array_equal(first.T_rs, np.eye(4))
    return () if at_origin else (f"where {name} is in the rig: poses are relative to it",)


def placed(cameras: Mapping[str, Camera]) -> tuple[str, ...]:
    """What gets lost where there are no poses."""
    return tuple(f"the pose of {name}" for name, one in cameras.items() if not np.array_equal(one.T_rs, np.eye(4)))


def extra(name: str, table: Mapping[str, Any], known: Sequence[str]) -> tuple[str, ...]:
    """Keys of a table that have no place in a camera."""
    unknown = [str(key) for key in table if key not in known]
    return (f"{name}: {', '.join(unknown)}",) if unknown else ()
