"""Shortens pauses by Python's thread switching and garbage collection, and keeps the memory of images."""

import ctypes
import gc
import sys

#: Switch interval between threads [s]; Python's default is 5 ms.
SWITCH_S = 0.0005

#: Parameters of `mallopt`, and their values [bytes]: blocks up to the largest size that glibc takes come from memory
#: that is kept, of which less than the second one is free at its end.
_MMAP_THRESHOLD, _KEPT_BLOCK = -3, 32 << 20
_TRIM_THRESHOLD, _KEPT_TAIL = -1, 256 << 20


def shorten_switch_interval() -> None:
    """Lets threads that send or receive interrupt one that computes."""
    sys.setswitchinterval(SWITCH_S)


def freeze_loaded_objects() -> None:
    """Excludes all present objects, mostly modules, from later garbage collections.

    A full collection over all modules takes 50 to 90 ms, two or three frames.
    """
    gc.collect()
    gc.freeze()


def keep_freed_memory() -> None:
    """Lets the next image use the memory of the last one, which the C library otherwise returns to the system.

    The system then clears every page again when it is first written, which takes longer than to copy the image.
    """
    allocator = ctypes.CDLL(None)
    if hasattr(allocator, "mallopt"):  # glibc's
        allocator.mallopt(_MMAP_THRESHOLD, _KEPT_BLOCK)
        allocator.mallopt(_TRIM_THRESHOLD, _KEPT_TAIL)
