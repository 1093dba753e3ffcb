"""Shots: synchronous observations by the sensors of a rig, from any source."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain, pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.contract.frame import ENCODINGS, Frame, FrameSet, Geometry, Kind

Array = NDArray[np.integer | np.floating]

#: Kinds of images for corner detection, the best first.
SOUGHT = (Kind.COLOR, Kind.BAYER, Kind.AMPLITUDE, Kind.IR, Kind.INTENSITY)
#: Further kinds of frames in a shot.
USED = frozenset({*SOUGHT, Kind.DEPTH, Kind.DEVIATION})

#: Images of active illumination, whose saturation invalidates distances.
OWN_LIGHT = frozenset({Kind.AMPLITUDE, Kind.IR})

#: Maximum interval for motion detection; over longer intervals the board may have moved and stopped again [ns].
_CLOSE_NS = 250_000_000

_GREY_OF_BAYER = {
    "bayer_rggb8": cv2.COLOR_BayerRGGB2GRAY,
    "bayer_bggr8": cv2.COLOR_BayerBGGR2GRAY,
    "bayer_gbrg8": cv2.COLOR_BayerGBRG2GRAY,
    "bayer_grbg8": cv2.COLOR_BayerGRBG2GRAY,
}

#: Placeholder for a missing image.
NO_IMAGE: Array = np.zeros((0, 0), np.uint8)
NO_DISTANCE: NDArray[np.float32] = np.zeros((0, 0), np.float32)


class ShotsError(Exception):
    """Images that a calibration cannot use; the message names their source."""


@dataclass(frozen=True, slots=True, eq=False)
class SensorShot:
    """Observation of one sensor in a shot.

    Attributes:
        t_ns: time of its exposure [ns]; all sensors of a rig have the same origin.
        image: for corner detection, (height, width) or (height, width, 3); `NO_IMAGE` if there is none.
        before: the previous image, or the same one without any; for motion detection.
        own_light: True if the image is of the sensor's own illumination.
        distance: radial distances (height, width) [m], NaN without return; `NO_DISTANCE` if it measures none.
        sigma: σ reported by the sensor (height, width) [m], NaN where it reports none.
        file: image file that it comes from; None if it is of a recording or a device.
    """

    t_ns: int
    image: Array
    before: Array
    own_light: bool = False
    distance: NDArray[np.float32] = field(default_factory=lambda: NO_DISTANCE)
    sigma: NDArray[np.float32] = field(default_factory=lambda: NO_DISTANCE)
    file: Path | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """Observations of all sensors at one time.

    Attributes:
        number: of the shot.
        sensor_shots: observation of each sensor, by sensor name; sensors without one are missing.
        frames: its frames, and preceding ones for motion detection; empty for image files.
    """

    number: int
    sensor_shots: Mapping[str, SensorShot]
    frames: tuple[Frame, ...] = ()

    @property
    def t_ns(self) -> int:
        """Time of the earliest exposure [ns]."""
        return min((look.t_ns for look in self.sensor_shots.values()), default=0)


class Assembler:
    """Converts frame sets to shots."""

    def __init__(self, cameras: Mapping[str, Camera]) -> None:
        self._cameras = cameras
        self._stretch: dict[str, NDArray[np.float32]] = {}

    def shot(self, number: int, frames: FrameSet, before: FrameSet) -> Shot:
        """Shot of a frame set.

        Raises:
            ShotsError: the size of a depth image differs from its camera's.
        """
        sensors = dict.fromkeys(sensor for sensor, _ in frames.frames)
        sensor_shots = {sensor: self._look(sensor, frames, before) for sensor in sensors}
        both = {
            (frame.key, frame.t_host_ns): frame for frames_ in (before, frames) for frame in frames_.frames.values()
        }
        return Shot(number, sensor_shots, tuple(both.values()))

    def _look(self, sensor: str, frames: FrameSet, before: FrameSet) -> SensorShot:
        now, earlier = _by_kind(sensor, frames), _by_kind(sensor, before)
        sought = next((kind for kind in SOUGHT if kind in now), None)
        depth = now.get(Kind.DEPTH)
        distance = NO_DISTANCE if depth is None else self._radial(depth)
        deviation = now.get(Kind.DEVIATION)
        sigma = np.full_like(distance, np.nan) if deviation is None else deviation.si()
        if sought is None:
            first = depth if depth is not None else next(iter(now.values()))
            return SensorShot(first.t_host_ns, NO_IMAGE, NO_IMAGE, distance=distance, sigma=sigma)
        image = pixels(now[sought])
        former = pixels(earlier.get(sought, now[sought]))
        return SensorShot(now[sought].t_host_ns, image, former, sought in OWN_LIGHT, distance, sigma)

    def _radial(self, depth: Frame) -> NDArray[np.float32]:
        distance = depth.si()
        if depth.geometry != Geometry.Z:
            return distance
        camera = self._cameras.get(depth.sensor)
        if camera is None or (camera.height, camera.width) != distance.shape:
            raise ShotsError(
                f"{depth.sensor}/{depth.stream}: distances along z need the camera model of {depth.sensor} for "
                f"{distance.shape[1]} × {distance.shape[0]} pixels"
            )
        if depth.sensor not in self._stretch:
            self._stretch[depth.sensor] = (1 / camera.rays()[..., 2]).astype(np.float32)
        return distance * self._stretch[depth.sensor]


def thinned(sets: Iterable[FrameSet], assembler: Assembler, every_s: float) -> Iterator[Shot]:
    """Shots from frame sets, at least `every_s` apart; the preceding set is used for motion detection.

    A set without a close predecessor is skipped if it has a close successor, whose motion is known. An isolated set is
    assumed static.

    Raises:
        ShotsError: as `Assembler.shot`.
    """
    last_ns: int | None = None
    before: FrameSet | None = None
    number = 0
    waiting: Iterator[FrameSet | None] = chain(sets, [None])
    for frames, after in pairwise(waiting):
        if frames is None:
            return
        compared = before if before is not None and _is_close(before, frames) else frames
        is_due = last_ns is None or frames.stamp_ns - last_ns >= every_s * 1e9
        if is_due and (compared is not frames or not _is_close(frames, after)):
            last_ns = frames.stamp_ns
            yield assembler.shot(number, frames, compared)
            number += 1
        before = frames


def _is_close(first: FrameSet | None, second: FrameSet | None) -> bool:
    return first is not None and second is not None and second.stamp_ns - first.stamp_ns <= _CLOSE_NS


def _by_kind(sensor: str, frames: FrameSet) -> dict[Kind, Frame]:
    return {frame.kind: frame for (name, _), frame in frames.frames.items() if name == sensor}


def pixels(frame: Frame) -> Array:
    """Image of a frame for board detection; a Bayer mosaic becomes grey."""
    if frame.kind == Kind.BAYER:
        return cv2.cvtColor(np.ascontiguousarray(frame.data, np.uint8), _GREY_OF_BAYER[frame.encoding])
    return frame.data.view(ENCODINGS[frame.encoding][0].type)
