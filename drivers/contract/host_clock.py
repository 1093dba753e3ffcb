"""Whose CLOCK_MONOTONIC this process reads: stamps of processes that share it need no mapping."""

import os
from functools import cache
from pathlib import Path


@cache
def host_clock() -> str:
    """Names the clock: the boot of the kernel, and the time namespace, which a container may have of its own.

    "" where the system does not tell; then nobody shares it.
    """
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot}-{os.stat('/proc/self/ns/time').st_ino}"
    except OSError:
        return ""
