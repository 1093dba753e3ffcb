"""Recordings of the ifm O3R platform: buffers of its process interface (PCIC)."""

from drivers.o3r.buffers import O3rBuffers

__all__ = ["open_recording"]

open_recording = O3rBuffers
