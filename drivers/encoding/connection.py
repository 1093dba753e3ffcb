"""A connection to a router, in zenoh's configuration: that of the bus and of a rig elsewhere."""

import os
import resource
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

SHARED_MEMORY = "/dev/shm"
PROCESS = Path("/proc/self")
#: Bit of the capability that lifts the limit of locked memory (capabilities(7)).
CAP_IPC_LOCK = 14

#: A peer without a keep-alive for this long is disconnected [ms].
LEASE_MS = 2000
#: Time between the tries to connect again to a router that is gone: at first, and at most [ms].
RETRY: Mapping[str, int] = {"period_init_ms": 250, "period_max_ms": 1000}
#: Longest time of a try [ms]. One that begins while the network is cut would, by default, wait for 10 s: TCP repeats
#: its question after 1, 3, 7 s and so does not know that the network is back.
UNICAST: Mapping[str, int] = {"open_timeout": 2000}
#: Levels of zenoh's log. What is off says of each message that its sender's wall clock is ahead, as another host's is,
#: or that one's own was set back. Only caches need these times, and zenoh mends those.
LOG_LEVELS = "error,zenoh::net::routing::dispatcher::pubsub=off"


def free_shared_memory() -> int:
    """Free shared memory [bytes]; 0 where there is none, or none that can be written."""
    try:
        status = os.statvfs(SHARED_MEMORY)
    except OSError:
        return 0
    return 0 if status.f_flag & os.ST_RDONLY else status.f_bavail * status.f_frsize


def may_lock_memory() -> bool:
    """True if this process may lock memory without limit; raises its limit to the highest that it may have.

    zenoh locks all shared memory that it maps, and keeps it for the process's life, that of ended processes included
    (eclipse-zenoh/zenoh #2787). At its limit it cannot read the next pool, and loses its messages without a word.
    """
    _, highest = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_MEMLOCK, (highest, highest))
    return highest == resource.RLIM_INFINITY or _is_capable()


def _is_capable() -> bool:
    """True with CAP_IPC_LOCK, unless only within a user namespace, where it does not lift the limit."""
    try:
        capabilities = (PROCESS / "status").read_text().partition("CapEff:")[2].split()[0]
        users = (PROCESS / "uid_map").read_text().split()
    except (OSError, IndexError):
        return False
    return bool(int(capabilities, 16) >> CAP_IPC_LOCK & 1) and users == ["0", "0", "4294967295"]
