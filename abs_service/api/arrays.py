"""Arrays of one moment, checked, as the frames that a device would deliver."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from abs_service.api import checks
from abs_service.api.checks import ArgumentError
from abs_service.pairing.images import BAYER_ORDERS
from abs_service.tracker.measurements import measurement
from abs_service.tracking.observer import streams
from calib.camera import Camera
from calib.noise.base import DepthNoise
from calib.noise.images.grey import GaussianGrey
from calib.rig import Rig
from drivers.contract.frame import Frame, FrameSet, Geometry, Kind

#: A depth image whose median is larger [m] is one in millimetres.
MAX_DISTANCE_M = 100.0

#: Times beyond it do not fit 64 bits of nanoseconds [s].
MAX_TIME_S = 9e9

#: Encodings of 8- and 16-bit images of the brightness.
_GREY = {"u1": "mono8", "u2": "mono16"}


class FrameBuilder:
    """Makes frame sets for the sensors of one tracker.

    Args:
        rig: the tracker's sensors.
        reference: the depth sensor that `depth_m`, `amplitude` and `deviation_m` are of.
        geometry: length in depth images, "z" or "radial".
        bayer: order of the colour filters in a Bayer mosaic's upper left corner, row by row.

    Raises:
        ArgumentError: an unknown geometry or order, or a reference that measures no distances.
    """

    def __init__(self, rig: Rig, reference: str, geometry: str, bayer: str):
        if geometry not in ("z", "radial"):
            raise ArgumentError(f'geometry = {geometry!r}: must be "z" or "radial"')
        if bayer not in list(BAYER_ORDERS):
            raise ArgumentError(f"bayer = {bayer!r}: must be one of {', '.join(BAYER_ORDERS)}")
        self._rig = rig
        self._geometry = Geometry(geometry)
        self._bayer = bayer
        self._cameras = {sensor.head: sensor.camera for sensor in rig.sensors.values()}
        self._streams = [f"{head}/{stream}" for head, stream in streams(rig.sensors.values())]
        pictures = [one for one in self._streams if one.endswith(("/color", "/bayer"))]
        own = {"depth_m": Kind.DEPTH, "amplitude": Kind.AMPLITUDE, "deviation_m": Kind.DEVIATION}
        named = {name: f"{reference}/{kind}" for name, kind in own.items()}
        #: Stream of every argument that has one.
        self._arguments = {name: stream for name, stream in named.items() if stream in self._streams}
        if "depth_m" not in self._arguments:
            needed = f'"{reference}" finds the object, so it needs a model of distances, such as noise.Constant(0.001)'
            raise ArgumentError(f"noise = {rig.sensors[reference].noise}: {needed}")
        self._grey = {sensor.head for sensor in rig.sensors.values() if isinstance(sensor.noise, GaussianGrey)}
        if len(pictures) == 1:
            self._arguments["image"] = pictures[0]
        self._last_ns: int | None = None
        self._seq = 0

    def frame_set(self, time_s: float, given: Mapping[str, ArrayLike | None]) -> FrameSet:
        """The frames of one moment.

        Args:
            time_s: the moment [s].
            given: arrays by the argument that they were given as or by their stream, "tof/depth"; None for none.

        Raises:
            ArgumentError: an array that does not fit, that nothing uses or that is missing; a time that is not later.
        """
        t_ns = self._time_ns(time_s)
        frames: dict[tuple[str, str], Frame] = {}
        for name, array in given.items():
            if array is None:
                continue
            stream = self._arguments.get(name, name)
            if stream not in self._streams:
                raise ArgumentError(f"{name} is given, but the tracker uses no such image; it uses {self._uses()}")
            head, _, kind = stream.partition("/")
            label = self._label(stream)
            if (head, kind) in frames:
                raise ArgumentError(f"{name} is given, and {label} too, which is the same image: leave one out")
            frames[head, kind] = self._frame(head, Kind(kind), checks.array(label, array), label, t_ns)
        self._check_complete(frames)
        self._last_ns, self._seq = t_ns, self._seq + 1
        return FrameSet(self._seq - 1, t_ns, frames)

    def without_return(self, frames: FrameSet) -> tuple[str, ...]:
        """Reason for no estimate: `depth_m` is given and none of its pixels holds a distance; else empty."""
        head, _, kind = self._arguments["depth_m"].partition("/")
        depth = frames.frames.get((head, kind))
        if depth is None or np.greater(depth.data, 0).any():
            return ()
        return ("depth_m has no return: all of it is 0 or NaN",)

    def _uses(self) -> str:
        return ", ".join(map(self._label, self._streams))

    def _label(self, stream: str) -> str:
        """The argument that an image is given as."""
        return next((name for name, own in self._arguments.items() if own == stream), f"streams[{stream!r}]")

    def _time_ns(self, time_s: float) -> int:
        seconds = checks.number("time_s", time_s, "a time in seconds")
        if not abs(seconds) < MAX_TIME_S:
            raise ArgumentError(
                f"time_s = {time_s}: must be a time in seconds, less than {MAX_TIME_S:g}: milliseconds * 1e-3, "
                "nanoseconds * 1e-9"
            )
        t_ns = round(seconds * 1e9)
        if self._last_ns is not None and t_ns <= self._last_ns:
            raise ArgumentError(f"time_s = {time_s}: must be later than the frame before, {self._last_ns * 1e-9:g}")
        return t_ns

    def _check_complete(self, frames: Mapping[tuple[str, str], Frame]) -> None:
        """Refuses a depth image without the amplitude or deviation that its noise model needs."""
        for sensor in self._rig.sensors.values():
            if not isinstance(sensor.noise, DepthNoise) or (sensor.head, "depth") not in frames:
                continue
            for kind in measurement(sensor.noise).frames:
                if (sensor.head, kind.value) not in frames:
                    label = self._label(f"{sensor.head}/{kind}")
                    raise ArgumentError(f'{label} is missing: the noise model of "{sensor.head}" depends on it')

    def _frame(self, head: str, kind: Kind, array: NDArray[Any], label: str, t_ns: int) -> Frame:
        camera = self._cameras[head]
        if kind == Kind.BINARY:
            array = np.full((camera.height, camera.width), array.astype(bool).any(), np.uint8)
        shape = array.shape[:2] if kind == Kind.COLOR and array.ndim == 3 else array.shape
        if shape != (camera.height, camera.width):
            raise ArgumentError(f"{label} {_misfit(array, camera)}")
        pixels, encoding = self._pixels(head, kind, array, label)
        is_depth = kind == Kind.DEPTH
        return Frame(
            sensor=head,
            stream=kind.value,
            kind=kind,
            data=pixels,
            encoding=encoding,
            t_host_ns=t_ns,
            t_arrival_ns=t_ns,
            seq=self._seq,
            geometry=self._geometry if is_depth else Geometry.NONE,
            invalid=0.0 if is_depth else None,
            calib_id=camera.calib_id,
        )

    def _pixels(self, head: str, kind: Kind, array: NDArray[Any], label: str) -> tuple[NDArray[Any], str]:
        """The pixels as a frame holds them, and their encoding."""
        if kind in (Kind.DEPTH, Kind.DEVIATION):
            return _metres(array, label), "32FC1"
        if kind == Kind.BINARY:
            return array, "mono8"
        if kind == Kind.BAYER and array.dtype == np.uint8:
            return np.ascontiguousarray(array), f"bayer_{self._bayer}8"
        if kind == Kind.COLOR and array.ndim == 3 and array.shape[2] == 3 and array.dtype == np.uint8:
            return np.ascontiguousarray(array), "rgb8"
        if kind == Kind.COLOR and array.ndim == 2 and head in self._grey and array.dtype.str[1:] in _GREY:
            return np.ascontiguousarray(array, f"<{array.dtype.str[1:]}"), _GREY[array.dtype.str[1:]]
        if kind in (Kind.COLOR, Kind.BAYER):
            raise ArgumentError(
                f"{label} holds {array.dtype} of shape {array.shape}, must be uint8, 0…255, of shape "
                "(height, width, 3); (height, width) if its noise model is Grey or Bayer"
            )
        if array.dtype.kind not in "uif":
            raise ArgumentError(f"{label} holds {array.dtype}, must be numbers")
        if (array < 0).any():
            raise ArgumentError(f"{label} holds {np.nanmin(array):g}: must be positive; NaN means no return")
        return np.ascontiguousarray(array, "<f4"), "32FC1"


def object_mask(mask: ArrayLike, camera: Camera) -> NDArray[np.bool_]:
    """Pixels of an object, where a mask is not zero.

    Raises:
        ArgumentError: a mask of another size than the camera's, or of something else than numbers.
    """
    pixels = checks.array("mask", mask)
    if pixels.shape != (camera.height, camera.width):
        raise ArgumentError(f"mask {_misfit(pixels, camera)}")
    if pixels.dtype.kind not in "buif" or np.isnan(pixels).any():
        content = "NaN" if pixels.dtype.kind == "f" else pixels.dtype
        raise ArgumentError(f"mask holds {content}, must be boolean, or numbers that are 0 beside the object")
    return pixels != 0


def _misfit(array: NDArray[Any], camera: Camera) -> str:
    """Message about an array that does not have the size of its camera's images."""
    needed = (camera.height, camera.width)
    turned = "; it is transposed" if array.shape[1::-1] == needed else ""
    return f"has shape {array.shape}, must be {needed}, (height, width) of its camera{turned}"


def _metres(array: NDArray[Any], label: str) -> NDArray[np.float32]:
    """Lengths [m], NaN where there is none: where they are not finite."""
    if array.dtype == np.uint8:
        raise ArgumentError(
            f"{label} holds uint8, must be floating-point metres: 8 bits are too few for distances; cv2.imread makes "
            "them of a 16-bit image unless it is given cv2.IMREAD_UNCHANGED"
        )
    if array.dtype.kind != "f":
        raise ArgumentError(f"{label} holds {array.dtype}, must be floating-point metres: millimetres * 0.001")
    some = array[::4, ::4]
    returns = some[np.isfinite(some) & (some != 0)]
    if returns.size and np.median(np.abs(returns)) > MAX_DISTANCE_M:
        raise ArgumentError(
            f"{label} has a median of {np.median(returns):g}, must be metres, less than {MAX_DISTANCE_M:g}: "
            "millimetres * 0.001"
        )
    with np.errstate(over="ignore"):
        metres = array.astype("<f4")
    metres[~np.isfinite(metres)] = np.nan
    if (metres < 0).any():
        raise ArgumentError(f"{label} holds {np.nanmin(metres):g}: must be positive; NaN or 0 means no return")
    return metres
