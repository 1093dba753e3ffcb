"""A rig file that another program may be writing at this moment: an editor, a copy from another host."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from abs_service.wire.commands import RefusedError

T = TypeVar("T")

#: Time for which a file that is read has not changed [s].
SETTLED_S = 0.5
#: The same, if what was read of it ends something: half of a file may be a whole configuration with less in it [s].
LONG_SETTLED_S = 3.0
#: Longest wait for that [s].
PATIENCE_S = 15.0
#: Time between two checks [s].
POLL_S = 0.05


@dataclass(frozen=True)
class Time:
    """Time: monotonic [s], of the wall clock [s], and what lets it pass."""

    monotonic: Callable[[], float] = time.monotonic
    wall: Callable[[], float] = time.time
    sleep: Callable[[float], None] = time.sleep


def read(path: Path, load: Callable[[], T], ends: Callable[[T], bool], time_: Time = Time()) -> T:
    """Content of a file that has not changed for a while.

    Args:
        path: the file.
        load: reads it; raises what it likes.
        ends: tells whether the content ends something that runs.
        time_: time.

    Raises:
        RefusedError: it changes all the time.
    """
    deadline_s = time_.monotonic() + PATIENCE_S
    while time_.monotonic() < deadline_s:
        state = _state(path)
        if _stays(path, state, SETTLED_S, time_):
            content = load()
            if _stays(path, state, LONG_SETTLED_S if ends(content) else 0.0, time_):
                return content
    raise RefusedError(f"{path} changes all the time; ask again when it is written")


def _stays(path: Path, state: tuple[int, int, int], settled_s: float, time_: Time) -> bool:
    """True when the file has been in a state for so long; False as soon as it is not."""
    begin_s = time_.monotonic()
    while _state(path) == state:
        if time_.monotonic() - begin_s >= settled_s or time_.wall() - state[2] * 1e-9 > settled_s:
            return True
        time_.sleep(POLL_S)
    return False


def _state(path: Path) -> tuple[int, int, int]:
    """Identity, size [bytes] and time of the last change [ns] of a file; zeros if there is none."""
    try:
        about = path.stat()
    except OSError:  # an editor may put another file in its place; `load` tells of one that is gone
        return 0, 0, 0
    return about.st_ino, about.st_size, about.st_mtime_ns
