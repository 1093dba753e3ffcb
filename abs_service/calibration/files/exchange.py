"""Which format a calibration of another program has, and the cameras in it."""

from collections.abc import Mapping
from pathlib import Path

import cv2

from abs_service.config.problems import allowed_instead
from calib.camera import Camera
from calib.formats import depthai, kalibr, mrcal, opencv, ros, tf, urdf
from calib.formats.content import Content, FormatError, Hints, Written

READERS = {
    "kalibr": kalibr.read,
    "ros": ros.read,
    "opencv": opencv.read,
    "depthai": depthai.read,
    "mrcal": mrcal.read,
}
WRITERS = {
    "kalibr": kalibr.write,
    "ros": ros.write,
    "opencv": opencv.write,
    "depthai": depthai.write,
    "mrcal": mrcal.write,
    "urdf": urdf.write,
    "tf": tf.write,
}

#: The format of our own calibration files.
OWN = "toml"

_BY_SUFFIX = {".toml": OWN, ".cameramodel": "mrcal", ".xml": "opencv", ".urdf": "urdf"}
_DIALECTS = {".xml": cv2.FILE_STORAGE_FORMAT_XML, ".json": cv2.FILE_STORAGE_FORMAT_JSON}

#: What only texts of one format hold, the most telling first.
_TELLING = (
    ("%YAML:", "opencv"),
    ("!!opencv-matrix", "opencv"),
    ('"cameraData"', "depthai"),
    ("opencv-matrix", "opencv"),
    ("cam0:", "kalibr"),
    ("camera_matrix:", "ros"),
)


class ExchangeError(Exception):
    """A file whose format is not known, or that is not of the format that it is said to be."""


def of_content(path: Path, text: str) -> str:
    """The format of a file, by its suffix or by what it holds.

    Raises:
        ExchangeError: it cannot be told.
    """
    if path.suffix in _BY_SUFFIX:
        return _BY_SUFFIX[path.suffix]
    found = next((name for mark, name in _TELLING if mark in text), None)
    if found is None:
        raise ExchangeError(
            f"{path}: its format cannot be told; say it with --from, one of {', '.join([OWN, *READERS])}"
        )
    return found


def of_name(path: Path) -> str:
    """The format of a file to be written, by its suffix.

    Raises:
        ExchangeError: several formats have this suffix.
    """
    if path.suffix not in _BY_SUFFIX:
        raise ExchangeError(f"{path}: several formats have such names; say one with --to: {', '.join([OWN, *WRITERS])}")
    return _BY_SUFFIX[path.suffix]


def read(path: Path, text: str, name: str, hints: Hints) -> Content:
    """The cameras in a file of another program.

    Raises:
        ExchangeError: it is not of this format, or holds what cannot be expressed.
    """
    if name not in READERS:
        raise ExchangeError(f"{path}: {name} is only written, not read; {allowed_instead(name, list(READERS))}")
    try:
        return READERS[name](text, hints)
    except FormatError as error:
        raise ExchangeError(f"{path}: {error}") from error


def write(path: Path, name: str, cameras: Mapping[str, Camera]) -> Written:
    """The text of a file for another program.

    Raises:
        ExchangeError: the format cannot express the cameras.
    """
    try:
        if name == "opencv":
            return opencv.write(cameras, _DIALECTS.get(path.suffix, cv2.FILE_STORAGE_FORMAT_YAML))
        return WRITERS[name](cameras)
    except FormatError as error:
        raise ExchangeError(f"{path}: {error}") from error
