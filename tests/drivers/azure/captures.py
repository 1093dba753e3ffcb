"""Makes captures of Microsoft's library: images, references and stamps are its own objects."""

import ctypes
from ctypes import POINTER, c_float, c_int, c_size_t, c_uint64, c_void_p
from typing import Any

import numpy as np

_HANDLE = POINTER(c_void_p)
_RELEASED = ctypes.CFUNCTYPE(None, c_void_p, c_void_p)
_FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "k4a_capture_create": (c_int, _HANDLE),
    "k4a_capture_set_color_image": (None, c_void_p, c_void_p),
    "k4a_capture_set_depth_image": (None, c_void_p, c_void_p),
    "k4a_capture_set_ir_image": (None, c_void_p, c_void_p),
    "k4a_capture_set_temperature_c": (None, c_void_p, c_float),
    "k4a_image_create_from_buffer": (
        *(c_int, c_int, c_int, c_int, c_int),
        *(c_void_p, c_size_t, _RELEASED, c_void_p, _HANDLE),
    ),
    "k4a_image_set_device_timestamp_usec": (None, c_void_p, c_uint64),
    "k4a_image_set_exposure_usec": (None, c_void_p, c_uint64),
}


def declare(sdk: Any) -> Any:
    """The library, with the functions declared that make captures."""
    for function, (result, *arguments) in _FUNCTIONS.items():
        getattr(sdk, function).restype = result
        getattr(sdk, function).argtypes = arguments
    return sdk


class Maker:
    """Makes captures of the library, and knows which images it still holds."""

    def __init__(self, sdk: Any) -> None:
        self.sdk = declare(sdk)
        self.held: dict[int, Any] = {}  # buffers of images that somebody has not released, by address
        self._on_release = _RELEASED(lambda buffer, context: self.held.pop(buffer, None) and None)

    def capture(self, temperature_c: float = 31.5) -> c_void_p:
        capture = c_void_p()
        assert self.sdk.k4a_capture_create(ctypes.byref(capture)) == 0
        self.sdk.k4a_capture_set_temperature_c(capture, temperature_c)
        return capture

    def add(
        self, capture: c_void_p, name: str, form: int, size: tuple[int, int], content: bytes, time_us: int,
        exposure_us: int = 0,
    ) -> None:  # fmt: skip
        """Adds the image `depth`, `ir` or `color`."""
        image, buffer = c_void_p(), ctypes.create_string_buffer(content, len(content))
        self.held[ctypes.addressof(buffer)] = buffer
        stride = 0 if form == 0 else len(content) // size[1] if form != 1 else size[0]
        arguments = form, *size, stride, buffer, len(content), self._on_release, None, ctypes.byref(image)
        assert self.sdk.k4a_image_create_from_buffer(*arguments) == 0
        self.sdk.k4a_image_set_device_timestamp_usec(image, time_us)
        self.sdk.k4a_image_set_exposure_usec(image, exposure_us)
        getattr(self.sdk, f"k4a_capture_set_{name}_image")(capture, image)
        self.sdk.k4a_image_release(image)


def noisy(seed: int, size: tuple[int, int]) -> np.ndarray:
    return np.random.default_rng(seed).integers(900, 1100, size[::-1]).astype("<u2")
