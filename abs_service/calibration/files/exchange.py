"""Format detection, reading and writing of other programs' calibrations."""

from collections.abc import Mapping
from pathlib import Path

import cv2

from abs_service.config.problems import allowed_instead
from calib.camera import Camera
from calib.formats import colmap, depthai, kalibr, mrcal, opencv, ros, tf, urdf
from calib.formats.content import Content, FormatError, Hints, Written

READERS = {
    "kalibr": kalibr.read,
    "ros": ros.read,
    "opencv": opencv.read,
    "depthai": depthai.read,
    "mrcal": mrcal.read,
    "colmap": colmap.read,
}
WRITERS = {
    "kalibr": kalibr.write,
    "ros": ros.write,
    "opencv": opencv.write,
    "depthai": depthai.write,
    "mrcal": mrcal.write,
    "colmap": colmap.write,
    "urdf": urdf.write,
    "tf": tf.write,
}

#: Format of our own calibration files.
OWN = "toml"

_BY_SUFFIX = {".toml": OWN, ".cameramodel": "mrcal", ".xml": "opencv", ".urdf": "urdf"}
_DIALECTS = {".xml": cv2.FILE_STORAGE_FORMAT_XML, ".json": cv2.FILE_STORAGE_FORMAT_JSON}

#: Distinctive strings of each format, the most specific first.
_TELLING = (
    ("%YAML:", "opencv"),
    ("!!opencv-matrix", "opencv"),
    ('"cameraData"', "depthai"),
    ("opencv-matrix", "opencv"),
    ("cam0:", "kalibr"),
    ("camera_matrix:", "ros"),
    ("distortion_model:", "ros"),
    ("CAMERA_ID, MODEL, WIDTH, HEIGHT", "colmap"),
)


class ExchangeError(Exception):
    """Unknown format, or a file that does not conform to its format."""


def of_content(path: Path, text: str) -> str:
    """Format of a file, from its suffix or content.

    Raises:
        ExchangeError: the format is ambiguous or unknown.
    """
    if path.suffix in _BY_SUFFIX:
        return _BY_SUFFIX[path.suffix]
    found = next((name for mark, name in _TELLING if mark in text), None)
    if found is None:
        raise ExchangeError(
            f"{path}: its format is not recognised; `calibrate convert --from` takes {', '.join([OWN, *READERS])}"
        )
    return found


def of_name(path: Path) -> str:
    """Format of a file to be written, from its suffix.

    Raises:
        ExchangeError: several formats have this suffix.
    """
    if path.suffix not in _BY_SUFFIX:
        raise ExchangeError(f"{path}: several formats have such names; say one with --to: {', '.join([OWN, *WRITERS])}")
    return _BY_SUFFIX[path.suffix]


def read(path: Path, text: str, name: str, hints: Hints) -> Content:
    """Cameras in a file of another program.

    Raises:
        ExchangeError: invalid file, or content that cannot be expressed.
    """
    if name not in READERS:
        raise ExchangeError(f"{path}: {name} is only written, not read; {allowed_instead(name, list(READERS))}")
    try:
        return READERS[name](text, hints)
    except FormatError as error:
        raise ExchangeError(f"{path}: {error}") from error
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        # Each reader says what it misses; this is what else a damaged file can hold in place of a number or a table.
        raise ExchangeError(f"{path}: not of the form of {name}: {type(error).__name__}: {error}") from error


def write(path: Path, name: str, cameras: Mapping[str, Camera]) -> Written:
    """Text of a file for another program.

    Raises:
        ExchangeError: the format cannot express the cameras.
    """
    try:
        if name == "opencv":
            return opencv.write(cameras, _DIALECTS.get(path.suffix, cv2.FILE_STORAGE_FORMAT_YAML))
        return WRITERS[name](cameras)
    except FormatError as error:
        raise ExchangeError(f"{path}: {error}") from error
