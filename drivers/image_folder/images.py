"""Image files as frames: formats are validated and never converted silently."""

import heapq
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.image_folder import image_file
from drivers.image_folder.listing import ImageFile, ImageFolderError


class Images(Protocol):
    """The images of one stream."""

    @property
    def files(self) -> Sequence[ImageFile]:
        """The images, in the order of their times."""
        ...

    @property
    def camera(self) -> Camera:
        """Camera that took the images."""
        ...

    def frame(self, file: ImageFile) -> Frame:
        """Reads one of `files`.

        Raises:
            ImageFolderError: the image has another format.
        """
        ...


@dataclass(frozen=True)
class DepthImages:
    """Stream `depth` of sensor `depth`: depth images of 16-bit integers or of floating-point numbers.

    Attributes:
        files: the images.
        camera: camera of the images.
        scale: length of one unit of integers [m].
        float_scale: length of one unit of floating-point numbers [m].
        geometry: type of distance, z or radial.
        invalid: the value that means "no return"; of floating-point numbers, what is not finite or not positive
            always does.
        masks: mask images by sequence number; where they are black or transparent, depth is "no return".
    """

    files: Sequence[ImageFile]
    camera: Camera
    scale: float
    geometry: Geometry = Geometry.Z
    invalid: int = 0
    masks: Mapping[int, Path] = field(default_factory=dict)
    float_scale: float = 1.0

    def frame(self, file: ImageFile) -> Frame:
        """Reads a depth image and applies its mask, if any."""
        depth = _read(file.path, self.camera)
        is_float = depth.dtype.kind == "f"
        if not (is_float or depth.dtype == np.uint16) or depth.ndim != 2:
            advice = (
                "; images of 8 bits are for looking at: export the distances themselves"
                if depth.dtype == np.uint8
                else ""
            )
            raise ImageFolderError(
                f"{file.path}: depth must have one channel of 16 bits or of floating-point numbers, this is "
                f"{_format(depth)}{advice}"
            )
        if is_float:
            depth = np.where((depth > 0) & np.isfinite(depth), depth, self.invalid)
        filters: tuple[str, ...] = ()
        if file.seq in self.masks:
            depth = np.where(_mask(self.masks[file.seq], self.camera), depth, depth.dtype.type(self.invalid))
            filters = ("mask",)
        return Frame(
            sensor="depth",
            stream="depth",
            kind=Kind.DEPTH,
            data=np.ascontiguousarray(depth, "<f4" if is_float else "<u2"),
            encoding="32FC1" if is_float else "16UC1",
            t_host_ns=file.t_ns,
            t_arrival_ns=file.t_ns,
            seq=file.seq,
            scale=self.float_scale if is_float else self.scale,
            geometry=self.geometry,
            invalid=self.invalid,
            clock_domain="file",
            calib_id=self.camera.calib_id,
            filters=filters,
        )


@dataclass(frozen=True)
class ColorImages:
    """Stream `color` of sensor `color`: 8-bit images; grey images get three equal channels, alpha is ignored."""

    files: Sequence[ImageFile]
    camera: Camera

    def frame(self, file: ImageFile) -> Frame:
        """Reads a colour image."""
        image = _read(file.path, self.camera)
        if image.dtype != np.uint8:
            raise ImageFolderError(f"{file.path}: colour must have 8 bits per channel, this is {_format(image)}")
        channels = np.repeat(image[..., None], 3, axis=-1) if image.ndim == 2 else image[..., 2::-1]
        return Frame(
            sensor="color",
            stream="color",
            kind=Kind.COLOR,
            data=np.ascontiguousarray(channels),
            encoding="rgb8",
            t_host_ns=file.t_ns,
            t_arrival_ns=file.t_ns,
            seq=file.seq,
            clock_domain="file",
            calib_id=self.camera.calib_id,
        )


@dataclass(frozen=True)
class ImageFolder:
    """The images of a folder."""

    streams: Mapping[str, Images]

    @property
    def cameras(self) -> Mapping[str, Camera]:
        """Cameras by sensor name."""
        return {sensor: images.camera for sensor, images in self.streams.items()}

    @property
    def total(self) -> int:
        """Number of images."""
        return sum(len(images.files) for images in self.streams.values())

    def frames(self) -> Iterator[Frame]:
        """Frames of all streams in order of time, read lazily."""
        streams = list(self.streams.values())
        numbered = [[(file.t_ns, number, file) for file in images.files] for number, images in enumerate(streams)]
        for _, number, file in heapq.merge(*numbered, key=lambda entry: entry[:2]):
            yield streams[number].frame(file)


def _read(path: Path, camera: Camera) -> NDArray[Any]:
    image = image_file.read(path)
    height, width = image.shape[:2]
    if (width, height) != (camera.width, camera.height):
        expected = f"{camera.width} × {camera.height}"
        raise ImageFolderError(f"{path}: the image has {width} × {height} pixels, its camera {expected}")
    return image


def _mask(path: Path, camera: Camera) -> NDArray[np.bool_]:
    """True where a mask keeps pixels: nonzero alpha if it has an alpha channel, else not black."""
    image = _read(path, camera)
    if image.ndim == 2:
        return image != 0
    return image[..., 3] != 0 if image.shape[2] == 4 else np.any(image != 0, axis=-1)


def _format(image: NDArray[np.generic]) -> str:
    channels = 1 if image.ndim == 2 else image.shape[2]
    kind = "" if image.dtype.kind == "u" else f" ({image.dtype})"
    return f"{channels} × {8 * image.dtype.itemsize} bit{kind}"
