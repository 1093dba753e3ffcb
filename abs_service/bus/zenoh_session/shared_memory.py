"""Shared memory, through which large messages pass between processes of one host."""

import os
import resource
from contextlib import suppress
from pathlib import Path

import zenoh

FOLDER = Path("/dev/shm")
PROCESS = Path("/proc/self")
#: Eight pools of a large rig, at 32 MB and what `abs_service.bus.zenoh_session.pools` adds [bytes].
LOCKED_BYTES = 8 * (36 << 20)
#: Bit of the capability that lifts the limit of locked memory (capabilities(7)).
CAP_IPC_LOCK = 14


def free_bytes() -> int:
    """Free shared memory [bytes]; 0 where there is none, or none that can be written."""
    try:
        status = os.statvfs(FOLDER)
    except OSError:
        return 0
    return 0 if status.f_flag & os.ST_RDONLY else status.f_bavail * status.f_frsize


def copied(payload: zenoh.ZBytes) -> bytes | None:
    """The bytes of a received message; None if their memory was given to another message before they were copied.

    zenoh takes shared memory back whose reader has not stirred for 100 ms, stopped or starved, and does not look at it
    again when the reader goes on: its bytes may be of both messages.
    """
    copy, shared = payload.to_bytes(), payload.as_shm()
    return copy if shared is None or shared.is_valid() else None


def may_be_locked() -> bool:
    """True if this process may lock the pools of a rig beside all that are there; raises its limit as far as it may.

    zenoh locks all shared memory that it maps, and keeps it for the process's life, that of ended processes included
    (eclipse-zenoh/zenoh #2787). At its limit it cannot read the next pool, and loses its messages without a word.
    """
    _, highest = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_MEMLOCK, (highest, highest))
    return highest == resource.RLIM_INFINITY or highest >= _segments_bytes() + LOCKED_BYTES or _is_capable()


def _segments_bytes() -> int:
    """Size of all that zenoh has in shared memory: the most that a process has mapped, since mapped files stay."""
    total = 0
    for path in FOLDER.glob("*.zenoh"):
        with suppress(OSError):  # removed in the meantime
            total += path.stat().st_size
    return total


def _is_capable() -> bool:
    """True with CAP_IPC_LOCK, unless only within a user namespace, where it does not lift the limit."""
    try:
        capabilities = (PROCESS / "status").read_text().partition("CapEff:")[2].split()[0]
        users = (PROCESS / "uid_map").read_text().split()
    except (OSError, IndexError):
        return False
    return bool(int(capabilities, 16) >> CAP_IPC_LOCK & 1) and users == ["0", "0", "4294967295"]
