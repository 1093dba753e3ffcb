"""Identity of the host's CLOCK_MONOTONIC: timestamps of processes that share it are comparable."""

import os
from functools import cache
from pathlib import Path


@cache
def host_clock() -> str:
    """Identifier of the clock: kernel boot id and time namespace (a container may have its own).

    "" if it cannot be read; such a clock is never shared.
    """
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot}-{os.stat('/proc/self/ns/time').st_ino}"
    except OSError:
        return ""
