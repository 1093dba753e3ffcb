"""Exit codes of the commands, and so the language between a process and its supervisor."""

from enum import IntEnum


class Exit(IntEnum):
    """Why a process ended."""

    OK = 0
    FAILED = 1  # something broke; starting again may help
    USER = 2  # the command line, the configuration or the surroundings have to be changed first
    GIVE_UP = 3  # cannot start, and starting again will not help
    INTERRUPTED = 130  # Ctrl-C before the command could end in order
    PIPE_CLOSED = 141  # whoever read the output is gone


def is_for_user(error: Exception) -> bool:
    """Whether an exception is one of ours, whose message says what to change. All others are our own mistakes."""
    return type(error).__module__.partition(".")[0] in ("abs_service", "drivers", "calib")
