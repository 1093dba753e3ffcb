"""Orbbec: Femto time-of-flight cameras and Gemini stereo cameras, and recordings played by Orbbec's SDK."""

from drivers.orbbec.address import parse
from drivers.orbbec.opening import discover, open_device

__all__ = ["check_address", "discover", "open_device"]

check_address = parse
