"""Keeps Python itself from pausing a process while a frame waits."""

import gc
import sys

#: For how long a thread may keep the others of its process from running Python code [s]; Python's own choice is 5 ms.
SWITCH_S = 0.0005


def shorten_switch_interval() -> None:
    """Lets a thread that has something to send or to receive interrupt one that computes."""
    sys.setswitchinterval(SWITCH_S)


def freeze_loaded_objects() -> None:
    """Takes all that exists now, mostly modules, out of every later search for garbage.

    A search through all modules takes 50 to 90 ms, two or three frames; what comes and goes with a frame takes none.
    """
    gc.collect()
    gc.freeze()
