"""CPU time and memory of processes and of the machine, from proc(5)."""

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

_TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True, slots=True)
class Usage:
    """CPU time and memory of a process.

    Attributes:
        cpu_s: user and system time of all threads [s].
        resident_bytes: resident set size (RSS) [bytes].
        private_bytes: RSS without files and shared memory [bytes].
    """

    cpu_s: float
    resident_bytes: int
    private_bytes: int


def usage(pid: int) -> Usage:
    """CPU time and memory of a process.

    Raises:
        OSError: there is no such process.
    """
    stat = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    # The name of the program, in brackets, may hold anything; user and system time are fields 14 and 15 of all.
    fields = stat.rpartition(")")[2].split()
    _, resident, shared, *_ = map(int, Path(f"/proc/{pid}/statm").read_text(encoding="utf-8").split())
    ticks = int(fields[11]) + int(fields[12])
    return Usage(ticks * _TICK_S, resident * _PAGE_BYTES, (resident - shared) * _PAGE_BYTES)


@dataclass(frozen=True, slots=True)
class Machine:
    """CPU times of the machine since boot, summed over all processors.

    Attributes:
        busy_s: time not idle [s].
        stolen_s: time taken by the host of a virtual machine (steal) [s].
    """

    busy_s: float
    stolen_s: float


def machine() -> Machine:
    """CPU times of the machine since boot."""
    fields = Path("/proc/stat").read_text(encoding="utf-8").splitlines()[0].split()
    user, nice, system, _, _, hard, soft, stolen = (int(field) * _TICK_S for field in fields[1:9])
    return Machine(user + nice + system + hard + soft, stolen)


def children(pid: int) -> Mapping[str, int]:
    """Process numbers of the commands of `abs-service` that a process has started, by command: the oldest of each.

    A younger one is another tracker. `fork-server` is what has forked the others.
    """
    found: dict[str, int] = {}
    for command, child in every_child(pid):
        found.setdefault(command, child)
    return found


def every_child(pid: int) -> list[tuple[str, int]]:
    """Commands of `abs-service` that descend from a process, each with its process number, the oldest first."""
    found: list[tuple[str, int]] = []
    for child in map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8").split()):
        with suppress(FileNotFoundError, ProcessLookupError):  # it has ended
            title = Path(f"/proc/{child}/cmdline").read_bytes().decode().replace("\0", " ").split()
            found += [(title[1], child)] if title[:1] == ["abs-service"] else []
            found += every_child(child)
    return found


def is_running(pid: int) -> bool:
    """True if a process exists and is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False
