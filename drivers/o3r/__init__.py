"""ifm O3R: live heads through ifm3dpy, and recordings: buffers of their process interface (PCIC)."""

from drivers.o3r.address import parse
from drivers.o3r.buffers import O3rBuffers
from drivers.o3r.opening import discover, open_device

__all__ = ["check_address", "discover", "open_device", "open_recording"]

check_address = parse
open_recording = O3rBuffers
