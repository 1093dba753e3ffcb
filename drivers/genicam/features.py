"""Meaning of a camera's images, by its features. Names are those of GenICam's SFNC, and of LUCID for its lens."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.camera import Camera, CameraError
from calib.lenses.lens import Lens, LensError
from drivers.contract.device import DeviceError
from drivers.contract.frame import Geometry
from drivers.genicam.address import Address

#: Formats of distances, the smallest first; Y is the intensity.
_FORMATS = ("Coord3D_CY16", "Coord3D_C16", "Coord3D_ABCY16", "Coord3D_ABC16", "Coord3D_C32f", "Coord3D_ABC32f")
#: Metres by unit.
_UNITS = {"Millimeter": 1e-3, "Inch": 0.0254}
#: Beginnings of output modes whose C is no distance, or that have no image.
_NO_DISTANCE = ("Disparity", "Uncalibrated", "CalibratedABC_PointCloud")
#: GenApi's access modes (`genapi.EAccessMode`).
_READABLE, _WRITABLE = frozenset({3, 4}), frozenset({2, 4})


def value(nodes: Any, *names: str) -> Any:
    """Value of the first of some features that can be read, None if there is none."""
    for name in names:
        node = getattr(nodes, name, None)
        if node is not None and node.get_access_mode() in _READABLE:
            return node.value
    return None


def settable(nodes: Any, name: str) -> Any:
    """A feature that can be set now, None if there is none."""
    node = getattr(nodes, name, None)
    return node if node is not None and node.get_access_mode() in _WRITABLE else None


def configure(nodes: Any, address: Address) -> None:
    """Selects the images and the format of distances that an address asks for.

    Raises:
        DeviceError: the camera lacks the format; names those that it has.
    """
    selector = settable(nodes, "ComponentSelector")
    if selector is not None:
        for name in selector.symbolics:
            selector.value = name
            if (enable := settable(nodes, "ComponentEnable")) is not None:
                enable.value = name in address.components
        if "Range" in selector.symbolics:
            selector.value = "Range"
    pixel_format = settable(nodes, "PixelFormat")
    there = () if pixel_format is None else pixel_format.symbolics
    if address.pixel_format and address.pixel_format not in there:
        raise DeviceError(f"{address.uri}: format = {address.pixel_format!r} is none of {', '.join(there)}")
    wanted = address.pixel_format or next((name for name in _FORMATS if name in there), "")
    if pixel_format is not None and wanted:
        pixel_format.value = wanted


@dataclass(frozen=True, slots=True)
class Distances:
    """Coordinate C of a pixel: what its value means.

    Attributes:
        scale: of one step [m].
        offset: added to values times scale [m].
        invalid: value without a measurement.
        geometry: along the optical axis in Cartesian coordinates, radial in spherical ones.
    """

    scale: float
    offset: float
    invalid: float
    geometry: Geometry


def distances(nodes: Any, uri: str) -> Distances:
    """Meaning of the distances, from the features or, after an image came, from its chunks.

    Raises:
        DeviceError: the camera sends no distances, or in an unknown unit; names the feature.
    """
    for prefix in ("", "Chunk"):
        selector = settable(nodes, f"{prefix}Scan3dCoordinateSelector")
        if selector is not None:
            selector.value = "CoordinateC"

    def read(name: str) -> Any:
        return value(nodes, f"Scan3d{name}", f"ChunkScan3d{name}")

    mode, unit, system = read("OutputMode") or "", read("DistanceUnit") or "Millimeter", read("CoordinateSystem")
    if mode.startswith(_NO_DISTANCE):
        raise DeviceError(f"{uri}: Scan3dOutputMode is {mode}, whose images hold no distances; set another one")
    if unit not in _UNITS or read("CoordinateSystemReference") == "Transformed":
        raise DeviceError(f"{uri}: distances must be in {' or '.join(_UNITS)} from the camera itself (Anchor)")
    scale, offset = (1.0 if (step := read("CoordinateScale")) is None else step), read("CoordinateOffset") or 0.0
    invalid = read("InvalidDataValue") if read("InvalidDataFlag") else None
    return Distances(
        scale * _UNITS[unit],
        offset * _UNITS[unit],
        0.0 if invalid is None else float(invalid),
        Geometry.RADIAL if system == "Spherical" else Geometry.Z,
    )


def camera(nodes: Any, width: int, height: int, address: Address) -> Camera:
    """Factory calibration; the principal point is in the middle if the camera reports none.

    Raises:
        DeviceError: nothing tells the focal length, or it is invalid.
    """
    lens = Lens()
    fx = fy = address.focal_px or value(nodes, "Scan3dFocalLength", "ChunkScan3dFocalLength")
    cx = value(nodes, "Scan3dPrincipalPointU", "ChunkScan3dPrincipalPointU")
    cy = value(nodes, "Scan3dPrincipalPointV", "ChunkScan3dPrincipalPointV")
    try:
        if fx is None and (fx := value(nodes, "CalibFocalLengthX")) is not None:
            fy = value(nodes, "CalibFocalLengthY")
            cx, cy = value(nodes, "CalibOpticalCenterX"), value(nodes, "CalibOpticalCenterY")
            lens = Lens(np.array(list(_distortion(nodes))))
        if fx is None:
            raise DeviceError(f"{address.uri}: the camera does not tell its focal length; tell it: ?focal=PIXELS")
        centre = ((width - 1) / 2 if cx is None else cx), ((height - 1) / 2 if cy is None else cy)
        return Camera(width, height, fx, fy, *centre, lens)
    except (CameraError, LensError) as error:
        raise DeviceError(f"{address.uri}: its calibration: {error}") from error


def _distortion(nodes: Any) -> Iterable[float]:
    """OpenCV's k1, k2, p1, p2, k3; zeros where the camera reports none."""
    for number in range(5):
        selector = settable(nodes, "CalibLensDistortionValueSelector")
        if selector is not None:
            selector.value = f"Value{number}"
        yield 0.0 if selector is None else float(value(nodes, "CalibLensDistortionValue"))
