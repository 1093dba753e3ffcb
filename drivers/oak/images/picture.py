"""Images of depthai, from messages or recordings, and their conversion to frames."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
from calib.pose import Pose
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.oak.eeprom import UNKNOWN, Extrinsics
from drivers.oak.images.lens import fitted
from drivers.oak.roles import Role

#: Greatest error of a lens with thin-prism or tilt coefficients, which `calib` has not [px]. Corners of boards are
#: detected to about as much.
LENS_ERROR_PX = 0.1

#: Supported lens models of depthai. The first has up to 14 coefficients in OpenCV's order.
PERSPECTIVE, FISHEYE = "PERSPECTIVE", "FISHEYE"


class PictureError(ValueError):
    """An unusable image; names the problem."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One `dai.ImgFrame`.

    Attributes:
        type: name of its pixel format.
        width, height: size [px].
        stride: bytes per row; 0 for no padding.
        data: its bytes.
        seq: sequence number.
        host_ns, device_ns: end of the exposure on the host's steady clock (depthai's estimate) and on the device's
            clock.
        exposure_s, gain, temperature_c: NaN if unknown; the gain is ISO speed over 100.
        socket: number of the camera socket.
        matrix: camera matrix (3, 3) of this image, crops and scaling included.
        model: name of the lens model.
        coefficients: of the lens model; empty if the device has undistorted the image.
        extrinsics: pose of the image's view, rectification and alignment included; `UNKNOWN` without.
    """

    type: str
    width: int
    height: int
    stride: int
    data: NDArray[np.uint8]
    seq: int
    host_ns: int
    device_ns: int
    exposure_s: float
    gain: float
    temperature_c: float
    socket: int
    matrix: NDArray[np.float64]
    model: str
    coefficients: tuple[float, ...]
    extrinsics: Extrinsics = UNKNOWN

    @property
    def half_exposure_ns(self) -> int:
        """Half of the exposure [ns], from its end to its middle; 0 if unknown."""
        return round(0.5e9 * self.exposure_s) if 0 < self.exposure_s < 1 else 0


def camera(picture: Picture, T_rs: Pose) -> Camera:
    """Camera of an image.

    Raises:
        PictureError: missing metadata, or an unsupported lens model.
    """
    values = np.asarray(picture.coefficients, np.float64)
    if picture.matrix.shape != (3, 3) or not np.all(np.isfinite(picture.matrix)):
        raise PictureError("the image comes without a camera matrix")
    if picture.model not in {PERSPECTIVE, FISHEYE}:
        raise PictureError(f"lens model {picture.model} is neither {PERSPECTIVE} nor {FISHEYE}")
    matrix, size = picture.matrix, (picture.width, picture.height)
    try:
        if picture.model == FISHEYE and np.any(values):
            fx, fy, cx, cy = (float(matrix[index]) for index in ((0, 0), (1, 1), (0, 2), (1, 2)))
            return Camera(*size, fx, fy, cx, cy, KannalaBrandt(values[:4]), T_rs)
        near = fitted(values, matrix, size)
        if not near.worst_px <= LENS_ERROR_PX:
            raise PictureError(
                f"the thin-prism and tilt coefficients of the lens cannot be had without an error of "
                f"{near.worst_px:.2g} px, more than {LENS_ERROR_PX} px; let the device undistort: undistort=1"
            )
        return Camera(*size, *near.matrix, near.lens, T_rs @ pose.inverse(near.T_fitted_camera))
    except PictureError:
        raise
    except (ValueError, cv2.error) as error:
        raise PictureError(f"the image's camera is none: {error}") from error


def frame(picture: Picture, role: Role, calib_id: str, filters: tuple[str, ...]) -> Frame:
    """Frame of an image, with device ticks and depthai's host time.

    Raises:
        PictureError: a format that does not fit the stream, or too few bytes.
    """
    encoding, data = pixels(picture, role.kind)
    is_depth = role.kind == Kind.DEPTH
    middle_ns = picture.half_exposure_ns
    return Frame(
        sensor=role.sensor,
        stream=role.stream,
        kind=role.kind,
        data=data,
        encoding=encoding,
        t_host_ns=max(picture.host_ns - middle_ns, 0),
        t_arrival_ns=max(picture.host_ns, 0),
        seq=picture.seq,
        scale=0.001 if is_depth else 1.0,
        geometry=Geometry.Z if is_depth else Geometry.NONE,
        invalid=0.0 if is_depth else None,
        t_device_ticks=picture.device_ns - middle_ns,
        tick_hz=1e9,
        clock_domain="oak",
        exposure_s=picture.exposure_s,
        gain=picture.gain,
        temperature_c=picture.temperature_c,
        calib_id=calib_id,
        undistorted=not any(picture.coefficients),
        filters=filters,
    )


def pixels(picture: Picture, kind: Kind) -> tuple[str, NDArray[np.generic]]:
    """Encoding and a copy of the pixels.

    Raises:
        PictureError: as `frame`.
    """
    decoders: Mapping[str, Callable[[Picture, Kind], tuple[str, NDArray[np.generic]]]] = {
        "RAW16": _words,
        "RAW8": _bytes,
        "GRAY8": _bytes,
        "BGR888i": _interleaved,
        "RGB888i": _interleaved,
        "BGR888p": _planar,
        "RGB888p": _planar,
        "NV12": _yuv,
        "YUV420p": _yuv,
    }
    if picture.type not in decoders:
        raise PictureError(f"pixel format {picture.type} is none of {sorted(decoders)}")
    encoding, image = decoders[picture.type](picture, kind)
    if (kind == Kind.DEPTH) != (encoding == "16UC1"):
        raise PictureError(f"{kind} cannot be {picture.type}")
    return encoding, image


def _rows(picture: Picture, bytes_per_row: int, rows: int) -> NDArray[np.uint8]:
    """A copy of the bytes (rows, bytes_per_row) without row padding."""
    stride = picture.stride or bytes_per_row
    if rows < 1 or not 0 < bytes_per_row <= stride:
        raise PictureError(
            f"{picture.width} × {picture.height} {picture.type} pixels in rows of {stride} bytes are none"
        )
    needed = stride * (rows - 1) + bytes_per_row
    if picture.data.size < needed:
        raise PictureError(f"{rows} rows of {stride} bytes need {needed} bytes, there are {picture.data.size}")
    padded = np.zeros(stride * rows, np.uint8)
    padded[: min(picture.data.size, padded.size)] = picture.data[: padded.size]
    return np.ascontiguousarray(padded.reshape(rows, stride)[:, :bytes_per_row])


def _words(picture: Picture, kind: Kind) -> tuple[str, NDArray[np.generic]]:
    words = _rows(picture, 2 * picture.width, picture.height).view("<u2")
    return "16UC1" if kind == Kind.DEPTH else "mono16", words


def _bytes(picture: Picture, kind: Kind) -> tuple[str, NDArray[np.generic]]:
    return "mono8", _rows(picture, picture.width, picture.height)


def _interleaved(picture: Picture, kind: Kind) -> tuple[str, NDArray[np.generic]]:
    rows = _rows(picture, 3 * picture.width, picture.height)
    return f"{picture.type[:3].lower()}8", rows.reshape(picture.height, picture.width, 3)


def _planar(picture: Picture, kind: Kind) -> tuple[str, NDArray[np.generic]]:
    planes = _rows(picture, picture.width, 3 * picture.height).reshape(3, picture.height, picture.width)
    return f"{picture.type[:3].lower()}8", np.ascontiguousarray(np.moveaxis(planes, 0, -1))


def _yuv(picture: Picture, kind: Kind) -> tuple[str, NDArray[np.generic]]:
    if picture.width % 2 or picture.height % 2:
        raise PictureError(f"{picture.type} images have an even size, not {picture.width} × {picture.height}")
    rows = _rows(picture, picture.width, picture.height * 3 // 2)
    conversion: Any = cv2.COLOR_YUV2BGR_NV12 if picture.type == "NV12" else cv2.COLOR_YUV2BGR_I420
    return "bgr8", np.asarray(cv2.cvtColor(rows, conversion))


def number(value: float, limit: float = math.inf) -> float:
    """A measured value, NaN where depthai gives 0 or less for unknown."""
    return float(value) if 0 < value < limit else math.nan
