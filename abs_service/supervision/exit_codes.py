"""Exit codes of the commands, which the supervisor evaluates, and whose fault an error is."""

import errno
import resource
from enum import IntEnum

_HOST = {
    errno.EMFILE,
    errno.ENFILE,
    errno.ENOMEM,
    errno.EAGAIN,
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EROFS,
    errno.EIO,
}


class Exit(IntEnum):
    """Reason of a process's end; docs/reference/command-line.md has a table for users."""

    OK = 0
    FAILED = 1  # something broke; starting again may help
    USER = 2  # the command line, the configuration or the surroundings have to be changed first
    NOTHING = 3  # nothing answers; starting again may help
    ENDED = 4  # of `capture`: its devices have ended by themselves, as a recording does; OK if that was requested
    INTERRUPTED = 130  # Ctrl-C before the command could end in order
    PIPE_CLOSED = 141  # the reader of the output has closed it


def is_for_user(error: Exception) -> bool:
    """True for exceptions of this project, which are user errors with an actionable message; others are bugs."""
    return type(error).__module__.partition(".")[0] in ("abs_service", "drivers", "calib")


def code_for(error: Exception) -> Exit:
    """The exit code of a command that an error ends."""
    if not is_for_user(error):
        return Exit.FAILED
    # Whoever does not answer yet may do so soon, which nobody has to change anything for.
    return Exit.NOTHING if isinstance(error, ConnectionError) else Exit.USER


def lack_of_host(error: Exception) -> str:
    """A lack of the host, such as of memory, descriptors or threads, in words; "" for an error of another kind."""
    if isinstance(error, MemoryError):
        return f"out of memory {error}".rstrip() + _memory_limit()
    # How Python says that there are too many threads, and the loader that a library has no room.
    words = str(error) == "can't start new thread" or "failed to map segment" in str(error)
    if words:
        return str(error) + _memory_limit()
    return str(error) if isinstance(error, OSError) and error.errno in _HOST else ""


def _memory_limit() -> str:
    """Says that memory is limited, where it is: a thread needs some, and its error does not tell."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return "" if limit == resource.RLIM_INFINITY else f"; memory is limited to {limit / 1e6:.0f} MB (ulimit -v)"
