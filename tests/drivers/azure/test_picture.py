"""Frames of images whose bytes may be anything."""

import contextlib
import math

from hypothesis import given
from hypothesis import strategies as st

from calib.camera import Camera
from drivers.azure.picture import AMPLITUDE, COLOR, DEPTH, PASSIVE, Picture, frame


@given(
    st.sampled_from([DEPTH, AMPLITUDE, PASSIVE, COLOR]),
    st.sampled_from(["DEPTH16", "IR16", "MJPG", "NV12", "YUY2", "BGRA", "unknown"]),
    st.integers(-2, 8),
    st.integers(-2, 8),
    st.binary(max_size=200),
)
def test_arbitrary_bytes_are_an_image_or_rejected(role, name: str, width: int, height: int, content: bytes) -> None:
    picture = Picture(role, name, width, height, content, 0, math.nan, math.nan)
    with contextlib.suppress(ValueError):
        made = frame(picture, Camera(8, 6, 8, 8, 4, 3), 0, "")
        assert made.data.shape[:2] == ((6, 8) if role is COLOR else (height, width))
