"""Exit codes of the commands, which the supervisor evaluates."""

from enum import IntEnum


class Exit(IntEnum):
    """Reason of a process's end; docs/reference/command-line.md has a table for users."""

    OK = 0
    FAILED = 1  # something broke; starting again may help
    USER = 2  # the command line, the configuration or the surroundings have to be changed first
    NOTHING = 3  # nothing answers
    ENDED = 4  # of `capture`: its devices have ended by themselves, as a recording does; OK if it was told to end
    INTERRUPTED = 130  # Ctrl-C before the command could end in order
    PIPE_CLOSED = 141  # the reader of the output has closed it


def is_for_user(error: Exception) -> bool:
    """True for exceptions of this project, which are user errors with an actionable message; others are bugs."""
    return type(error).__module__.partition(".")[0] in ("abs_service", "drivers", "calib")
