"""Frames of one exposure: pixel formats by their names in GenICam's PFNC."""

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.contract.frame import ENCODINGS, Frame, Geometry, Kind, Reference
from drivers.genicam.features import Distances
from drivers.genicam.link import Part, Shot

#: Name of the only sensor: all images are of one view.
SENSOR = "depth"

_FORMAT = re.compile(r"(Coord3D_|Mono|Confidence|RGBa?)([ABCY]*)(8|10|12|14|16|32f)(_Planar)?")
_DTYPES = {"8": np.dtype("u1"), "32f": np.dtype("<f4")}
_KINDS = {"Mono": Kind.INTENSITY, "Confidence": Kind.CONFIDENCE, "RGB": Kind.COLOR, "RGBa": Kind.COLOR}
_ENCODINGS = {Kind.DEPTH: ("16UC1", "32FC1"), Kind.COLOR: ("rgb8",)}


class PixelError(ValueError):
    """An image that cannot be used; names its format."""


def frames(shot: Shot, distances: Distances, calib_id: str, exposure_s: float) -> Iterator[Frame]:
    """All images of an exposure, one of each kind, with zeros as host times.

    Raises:
        PixelError: an unknown format, or an image with too few bytes.
    """
    seen: set[str] = set()
    for part in shot.parts:
        for kind, image in _images(part):
            if kind.value in seen:
                continue
            seen.add(kind.value)
            data, meaning = _depth(image, distances) if kind == Kind.DEPTH else (image, {})
            yield Frame(
                *(SENSOR, kind.value, kind, data, _encoding(part, kind, data.dtype)),
                t_host_ns=0,
                t_arrival_ns=0,
                seq=shot.number,
                t_device_ticks=shot.time_ns or 0,
                tick_hz=0.0 if shot.time_ns is None else 1e9,
                clock_domain="host" if shot.time_ns is None else "genicam",
                t_reference=Reference.MIDDLE if shot.time_ns is None else Reference.START,
                exposure_s=exposure_s,
                calib_id=calib_id,
                **meaning,
            )


def _depth(image: NDArray[Any], distances: Distances) -> tuple[NDArray[Any], dict[str, Any]]:
    """The raw image, or metres if an offset is added, which frames do not know."""
    if distances.offset == 0:
        return image, _meaning(distances.geometry, distances.scale, distances.invalid)
    metres = image.astype(np.float32) * np.float32(distances.scale) + np.float32(distances.offset)
    metres[image == distances.invalid] = np.nan
    return metres, _meaning(distances.geometry, 1.0, None)


def _meaning(geometry: Geometry, scale: float, invalid: float | None) -> dict[str, Any]:
    return {"geometry": geometry, "scale": scale, "invalid": invalid}


def _images(part: Part) -> Iterator[tuple[Kind, NDArray[Any]]]:
    """Kinds and images (height, width) or, of colours, (height, width, 3) of one part; none of one without C."""
    match = _FORMAT.fullmatch(part.pixel_format)
    if match is None:
        raise PixelError(f"{part.pixel_format}: unknown format")
    name, letters, bits, planar = match.groups()
    dtype = _DTYPES.get(bits, np.dtype("<u2"))
    if name != "Coord3D_":
        channels = {"RGB": 3, "RGBa": 4}.get(name, 1)
        image = _rows(part, dtype, channels, 1)[0]
        yield _KINDS[name], np.ascontiguousarray(image[:, :, :3]) if channels > 1 else image[:, :, 0]
        return
    values = _rows(part, dtype, 1, len(letters)) if planar else _rows(part, dtype, len(letters), 1)
    for letter, kind in (("C", Kind.DEPTH), ("Y", Kind.INTENSITY)):
        if letter in letters:
            index = letters.index(letter)
            yield kind, np.ascontiguousarray(values[index, :, :, 0] if planar else values[0, :, :, index])


def _rows(part: Part, dtype: np.dtype, channels: int, planes: int) -> NDArray[Any]:
    """Values (planes, height, width, channels) without the padding of rows."""
    rows = planes * part.height
    used = part.width * channels * dtype.itemsize
    stride = used + part.padding
    if rows == 0 or len(part.data) < rows * stride:
        raise PixelError(f"{part.pixel_format}: {len(part.data)} bytes are too few for {part.width} × {part.height}")
    content = np.frombuffer(part.data, np.uint8, rows * stride).reshape(rows, stride)[:, :used]
    return np.ascontiguousarray(content).view(dtype).reshape(planes, part.height, part.width, channels)


def _encoding(part: Part, kind: Kind, dtype: np.dtype) -> str:
    for name in _ENCODINGS.get(kind, ("mono8", "mono16", "32FC1")):
        if ENCODINGS[name][0] == dtype:
            return name
    raise PixelError(f"{part.pixel_format} is not supported")
