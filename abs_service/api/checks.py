"""Arguments of a type that cannot be used, refused by name, value and what is allowed."""

from collections.abc import Mapping
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera


class ArgumentError(ValueError):
    """An argument that cannot be used; the message names it, its value and the allowed values."""


def number(name: str, value: Any, allowed: str) -> float:
    """A number, finite or not; a truth value is none.

    Raises:
        ArgumentError: anything else.
    """
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real):
        raise ArgumentError(f"{name} = {value!r}: must be {allowed}")
    return float(value)


def positive(name: str, value: Any, allowed: str) -> None:
    """Refuses all but numbers above 0.

    Raises:
        ArgumentError: anything else.
    """
    if not number(name, value, allowed) > 0:
        raise ArgumentError(f"{name} = {value}: must be {allowed}")


def camera(name: str, value: Any) -> Camera:
    """A camera.

    Raises:
        ArgumentError: anything else.
    """
    if not isinstance(value, Camera):
        raise ArgumentError(
            f"{name} = {value!r}: must be a camera, such as Camera(640, 480, fx=528, fy=528, cx=320, cy=240)"
        )
    return value


def path(value: Any) -> Path:
    """The path of a file.

    Raises:
        ArgumentError: neither text nor a path.
    """
    if not isinstance(value, (str, Path)):
        raise ArgumentError(f"path = {value!r}: must be the path of a file, as str or pathlib.Path")
    return Path(value)


def mapping(name: str, value: Any, example: str) -> Mapping[str, Any]:
    """A dict or another mapping.

    Raises:
        ArgumentError: anything else.
    """
    if not isinstance(value, Mapping):
        raise ArgumentError(f"{name} = {value!r}: must be a dict such as {example}")
    return value


def array(name: str, value: Any) -> NDArray[Any]:
    """The value as an array.

    Raises:
        ArgumentError: rows of different length, or an array with a mask of its own, which would be ignored.
    """
    if isinstance(value, np.ma.MaskedArray):
        raise ArgumentError(f"{name} is a masked array: must be a plain one, {name}.filled(…)")
    try:
        return np.asarray(value)
    except ValueError as error:
        raise ArgumentError(f"{name} is no array: {error}") from error
