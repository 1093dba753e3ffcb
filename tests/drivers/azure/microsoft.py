"""Microsoft's own geometry, player and recorder, to compare with."""

import ctypes
import importlib.metadata
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import POINTER, c_char_p, c_float, c_int, c_size_t, c_void_p
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.azure import library
from drivers.azure.calibration import COLOR_MODES, DEPTH_MODES
from drivers.azure.library import Configuration
from tests.drivers.azure.captures import declare

_HANDLE = POINTER(c_void_p)
_FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "k4a_calibration_get_from_raw": (c_int, c_char_p, c_size_t, c_int, c_int, c_void_p),
    "k4a_calibration_3d_to_2d": (c_int, c_void_p, c_void_p, c_int, c_int, c_void_p, POINTER(c_int)),
    "k4a_calibration_2d_to_3d": (c_int, c_void_p, c_void_p, c_float, c_int, c_int, c_void_p, POINTER(c_int)),
    "k4a_transformation_create": (c_void_p, c_void_p),
    "k4a_transformation_destroy": (None, c_void_p),
    "k4a_transformation_depth_image_to_point_cloud": (c_int, c_void_p, c_void_p, c_int, c_void_p),
    "k4a_transformation_depth_image_to_color_camera": (c_int, c_void_p, c_void_p, c_void_p),
    "k4a_image_create": (c_int, c_int, c_int, c_int, c_int, _HANDLE),
    "k4a_playback_open": (c_int, c_char_p, _HANDLE),
    "k4a_playback_close": (None, c_void_p),
    "k4a_playback_get_raw_calibration": (c_int, c_void_p, c_char_p, POINTER(c_size_t)),
    "k4a_playback_get_next_capture": (c_int, c_void_p, _HANDLE),
    "k4a_record_create": (c_int, c_char_p, c_void_p, Configuration, _HANDLE),
    "k4a_record_add_attachment": (c_int, c_void_p, c_char_p, c_char_p, c_size_t),
    "k4a_record_write_header": (c_int, c_void_p),
    "k4a_record_write_capture": (c_int, c_void_p, c_void_p),
    "k4a_record_close": (None, c_void_p),
}
#: Room for a `k4a_calibration_t`, which has 1032 bytes.
_ROOM = 4096


class Microsoft:
    """The SDK and its recorder's library; ImportError if they are not installed."""

    def __init__(self) -> None:
        self.sdk = declare(library.load())
        files = importlib.metadata.files("pyk4a-bundle") or []
        record = ctypes.CDLL(next(str(path.locate()) for path in files if path.name.startswith("libk4arecord-")))
        self._functions: dict[str, Any] = {}
        for function, (result, *arguments) in _FUNCTIONS.items():
            found = getattr(record if "_playback_" in function or "_record_" in function else self.sdk, function)
            found.restype, found.argtypes = result, arguments
            self._functions[function] = found

    def __getattr__(self, name: str) -> Any:
        return self._functions[f"k4a_{name}"]

    def calibration(self, raw: bytes, depth: str, color: str) -> Any:
        """Calibration of the device in two modes."""
        room, content = ctypes.create_string_buffer(_ROOM), raw.rstrip(b"\0") + b"\0"
        modes = [*DEPTH_MODES].index(depth) + 1, [*COLOR_MODES].index(color) + 1
        assert self.calibration_get_from_raw(content, len(content), *modes, room) == 0
        return room

    def project(self, calibration: Any, points_d: NDArray[np.float64], head: str) -> NDArray[np.float64]:
        """Pixels (n, 2) of points (n, 3) in depth coordinates [m]; NaN where the SDK calls a point invalid."""
        pixels = np.full((len(points_d), 2), np.nan)
        for number, point in enumerate(points_d):
            point_mm, pixel, valid = (c_float * 3)(*(1e3 * point)), (c_float * 2)(), c_int()
            target = {"depth": 0, "color": 1}[head]
            arguments = calibration, point_mm, 0, target, pixel, ctypes.byref(valid)
            assert self.calibration_3d_to_2d(*arguments) == 0
            if valid.value:
                pixels[number] = pixel
        return pixels

    def points(self, calibration: Any, pixels: NDArray[np.int64], depth_mm: NDArray[Any]) -> NDArray[np.float64]:
        """Points (n, 3) in depth coordinates [m] of pixels (n, 2) of a depth image; NaN where they are invalid."""
        points_d = np.full((len(pixels), 3), np.nan)
        for number, (place, value) in enumerate(zip(pixels, depth_mm, strict=True)):
            pixel, point_mm, valid = (c_float * 2)(*place), (c_float * 3)(), c_int()
            arguments = calibration, pixel, float(value), 0, 0, point_mm, ctypes.byref(valid)
            assert self.calibration_2d_to_3d(*arguments) == 0
            if valid.value:
                points_d[number] = np.array(point_mm) * 1e-3
        return points_d

    @contextmanager
    def engine(self, calibration: Any) -> Iterator[Any]:
        """Engine that transforms whole images, in OpenGL; None where it does not start, as without an X session."""
        transformation = self.transformation_create(calibration)
        try:
            yield transformation
        finally:
            if transformation:
                self.transformation_destroy(transformation)

    def cloud(self, engine: Any, depth_image: Any, size: tuple[int, int]) -> NDArray[np.int16]:
        """Points (height, width, 3) of a depth image [mm], 0 without return."""
        cloud, (width, height) = self._image(8, size, 6), size
        assert self.transformation_depth_image_to_point_cloud(engine, depth_image, 0, cloud) == 0
        return np.frombuffer(self._taken(cloud), "<i2").reshape(height, width, 3)

    def in_color(self, engine: Any, depth_image: Any, size: tuple[int, int]) -> NDArray[np.uint16]:
        """A depth image as the colour camera sees it, (height, width) [mm], 0 where nothing is known."""
        warped = self._image(4, size, 2)
        assert self.transformation_depth_image_to_color_camera(engine, depth_image, warped) == 0
        return np.frombuffer(self._taken(warped), "<u2").reshape(size[::-1])

    def _image(self, form: int, size: tuple[int, int], pixel_bytes: int) -> c_void_p:
        image = c_void_p()
        assert self.image_create(form, *size, pixel_bytes * size[0], ctypes.byref(image)) == 0
        return image

    def _taken(self, image: c_void_p) -> bytes:
        content = ctypes.string_at(self.sdk.k4a_image_get_buffer(image), self.sdk.k4a_image_get_size(image))
        self.sdk.k4a_image_release(image)
        return content

    @contextmanager
    def player(self, path: Path) -> Iterator[tuple[bytes, list[c_void_p]]]:
        """The calibration and all captures of a recording."""
        playback, size = c_void_p(), c_size_t()
        assert self.playback_open(str(path).encode(), ctypes.byref(playback)) == 0
        captures: list[c_void_p] = []
        try:
            self.playback_get_raw_calibration(playback, None, ctypes.byref(size))
            raw = ctypes.create_string_buffer(size.value)
            assert self.playback_get_raw_calibration(playback, raw, ctypes.byref(size)) == 0
            capture = c_void_p()
            while self.playback_get_next_capture(playback, ctypes.byref(capture)) == 0:
                captures.append(c_void_p(capture.value))
            yield raw.raw, captures
        finally:
            for one in captures:
                self.sdk.k4a_capture_release(one)
            self.playback_close(playback)

    def record(self, path: Path, configuration: Configuration, raw: bytes, captures: list[c_void_p]) -> None:
        """Writes a recording of captures, which are released."""
        record = c_void_p()
        assert self.record_create(str(path).encode(), None, configuration, ctypes.byref(record)) == 0
        assert self.record_add_attachment(record, b"calibration.json", raw, len(raw)) == 0
        assert self.record_write_header(record) == 0
        for capture in captures:
            assert self.record_write_capture(record, capture) == 0
            self.sdk.k4a_capture_release(capture)
        self.record_close(record)
