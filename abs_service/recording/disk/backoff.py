"""Pauses between attempts to record on a disk that fails: a disk may take the beginning of every file."""

from collections.abc import Callable
from pathlib import Path

from abs_service.recording.disk import folder

#: Doublings of the pause at most, one for each file that failed before its first flush, since each one is left.
DOUBLINGS = 5


class Backoff:
    """Pauses that become longer with each file that is left.

    Args:
        directory: of the recordings.
        retry_s: shortest pause [s].
        wait: passes the time given in seconds; returns True if nothing is to be waited for any more.
        alive: called all the time, to say that it is not the disk that is waited for.

    Attributes:
        left: number of files in a row that failed before their first flush.
    """

    def __init__(
        self, directory: Path, retry_s: float, wait: Callable[[float], bool], alive: Callable[[], None]
    ) -> None:
        self._directory, self._retry_s, self._wait, self._alive = directory, retry_s, wait, alive
        self.left = 0

    def pause(self) -> None:
        """Waits; no longer than until the disk takes what it refused during the pause."""
        refused = False
        for _ in range(2 ** min(self.left, DOUBLINGS)):
            self._alive()
            if self._wait(self._retry_s):
                return
            if self.left:
                takes = folder.takes(self._directory)
                if refused and takes:
                    return
                refused = refused or not takes
