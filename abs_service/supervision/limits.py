"""Limits of a supervisor: when it gives up a process, and how long it waits for one."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits and timeouts of a supervisor.

    Attributes:
        restarts, window_ns: a process that needs more restarts than this within the window is given up, for as long
            [ns].
        startup_ns: timeout for the first health, and between healths while a process reports to be busy [ns], as long
            as it does anything.
        stall_ns: timeout between healths afterwards; a process that exceeds it is restarted [ns]. The time that it
            waited for a processor is added, up to `startup_ns`.
        stop_ns: time that all processes together have to end in order [ns].
    """

    restarts: int = 5
    window_ns: int = 60_000_000_000
    startup_ns: int = 180_000_000_000
    stall_ns: int = 10_000_000_000
    stop_ns: int = 4_000_000_000
