"""The header of a .sens file, and its two cameras.

Source: `sensorData.h`, version 4, of ScanNet's SensReader and of BundleFusion. Numbers are little-endian, matrices row
by row. Neither camera has a lens distortion. There is no library on PyPI that reads the format.
"""

import struct
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from calib.pose import Pose
from drivers.encoding.image_size import MAX_PIXELS

#: The only version: those before are of files named .sensor, or were never published.
VERSION = 4
#: Longest name of a sensor [bytes].
MAX_NAME_LENGTH = 1024
#: Most frames: six days at 30 Hz.
MAX_FRAMES = 1 << 24
#: Units of depth that a metre may have.
SHIFTS = (1.0, 1e6)

#: Version, and number of bytes of the sensor's name, which follows.
_BEGIN = struct.Struct("<IQ")
#: Four matrices, two compressions, sizes of colour and depth images, units of depth per metre, number of frames.
_REST = struct.Struct("<64f2i4IfQ")


class SensError(ValueError):
    """Malformed or unsupported bytes of a .sens file; names field, value and what is allowed."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageHeader:
    """The part of a header that is of one kind of images.

    Attributes:
        name: `color` or `depth`, as in the fields of the format.
        intrinsic: camera matrix (4, 4) [px].
        extrinsic: camera to the base frame of all cameras (4, 4) [m].
        compression: number of the compression.
        width, height: of the images [px].
    """

    name: str
    intrinsic: NDArray[np.float64]
    extrinsic: NDArray[np.float64]
    compression: int
    width: int
    height: int

    def camera(self, T_rs: Pose) -> Camera:
        """The camera that took the images, with its pose in the rig.

        Raises:
            SensError: no camera matrix without skew, or no images of an allowed size.
        """
        K = self.intrinsic[:3, :3]
        fx, fy, cx, cy = (float(K[index]) for index in ((0, 0), (1, 1), (0, 2), (1, 2)))
        named = f"intrinsic_{self.name} = {K.tolist()}"
        if np.array_equal(K, np.eye(3)):
            raise SensError(f"{named}: the camera is not calibrated")
        if not np.allclose(K, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], rtol=0, atol=1e-6):
            raise SensError(f"{named}: must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
        if self.width * self.height > MAX_PIXELS:
            size = f"{self.name} images of {self.width} × {self.height} pixels"
            raise SensError(f"{size}: {MAX_PIXELS} pixels are allowed")
        try:
            return Camera(self.width, self.height, fx, fy, cx, cy, T_rs=T_rs)
        except ValueError as error:
            raise SensError(f"{self.name} images: {error}") from error

    def T_bs(self) -> Pose:
        """Pose that maps coordinates of the camera to the base frame.

        Raises:
            SensError: the matrix is no pose.
        """
        try:
            if not np.array_equal(self.extrinsic[3], (0, 0, 0, 1)):
                raise ValueError(f"the last row is {self.extrinsic[3].tolist()}")
            return pose.from_rotation(self.extrinsic[:3, :3], self.extrinsic[:3, 3])
        except ValueError as error:
            raise SensError(f"extrinsic_{self.name}: must be a rotation and a translation [m]: {error}") from error


@dataclass(frozen=True, slots=True, eq=False)
class Header:
    """A header.

    Attributes:
        color, depth: what it says of the images.
        depth_scale: length of one unit of depth [m].
        count: number of frames that the file claims to have.
        end: where the first frame begins [bytes].
    """

    color: ImageHeader
    depth: ImageHeader
    depth_scale: float
    count: int
    end: int


def read(stream: BinaryIO) -> Header:
    """Reads the header at the beginning of a file.

    Raises:
        SensError: it is none, of another version, or has values that are not allowed.
    """
    version, length = _BEGIN.unpack(_exactly(stream, _BEGIN.size))
    if version != VERSION:
        raise SensError(f"version = {version}: only {VERSION} can be read; or this is no .sens file")
    if length > MAX_NAME_LENGTH:
        raise SensError(f"the sensor's name has {length} bytes, {MAX_NAME_LENGTH} are allowed")
    _exactly(stream, length)
    *numbers, color, depth, color_width, color_height, depth_width, depth_height, shift, count = _REST.unpack(
        _exactly(stream, _REST.size)
    )
    color_K, color_T, depth_K, depth_T = np.reshape(np.array(numbers, np.float64), (4, 4, 4))
    minimum, maximum = SHIFTS
    if not minimum <= shift <= maximum:
        raise SensError(f"depth_shift = {shift}: must be from {minimum:g} to {maximum:g} units per metre")
    if not 0 < count <= MAX_FRAMES:
        why = "" if count else "; a recorder that was interrupted leaves 0"
        raise SensError(f"num_frames = {count}: must be from 1 to {MAX_FRAMES}{why}")
    return Header(
        ImageHeader("color", color_K, color_T, color, color_width, color_height),
        ImageHeader("depth", depth_K, depth_T, depth, depth_width, depth_height),
        1 / shift,
        count,
        stream.tell(),
    )


def _exactly(stream: BinaryIO, size: int) -> bytes:
    content = stream.read(size)
    if len(content) < size:
        raise SensError("this is no .sens file: it ends within the header")
    return content
