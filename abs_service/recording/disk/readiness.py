"""Checks before each recording, and while a recorder waits for its trigger, that one can begin."""

import os
from collections.abc import Callable
from pathlib import Path

from abs_service.bus.health import Health, Level
from abs_service.recording.disk import folder
from abs_service.recording.disk.space import Space

#: Time between two checks while nothing is recorded [ns].
POLL_NS = 1_000_000_000


class Readiness:
    """Checks the folder of recordings and its disk.

    Args:
        directory: the folder.
        space: room on its disk.
        health: of the recorder.
        clock: monotonic time [ns].
    """

    def __init__(self, directory: Path, space: Space, health: Health, clock: Callable[[], int]) -> None:
        self._directory, self._space, self._health, self._clock = directory, space, health, clock
        self._mount = Path("/")  # of the disk that has the recordings
        self._next_ns = 0

    def begun(self) -> None:
        """Keeps in mind which disk has the recordings, since one has begun."""
        self._mount = folder.mount_point(self._directory)

    def check(self) -> None:
        """Makes the folder if need be.

        Raises:
            OSError: no recording can begin.
        """
        self._health.report("readiness", Level.OK)  # who begins tells the rest
        self._check()

    def look(self, failed: bool) -> bool:
        """Tells, once a second while nothing is to be recorded, if nothing could be; True if a failure is over.

        Args:
            failed: the last recording has failed, so that the disk is written to find out.
        """
        if self._clock() < self._next_ns:
            return False
        self._next_ns = self._clock() + POLL_NS
        try:
            self._check()
            if not os.access(self._directory, os.W_OK | os.X_OK):
                raise OSError(f"{self._directory} cannot be written")
        except OSError as error:
            self._health.report("readiness", Level.ERROR, f"nothing could be recorded: {error}")
            return False
        self._health.report("readiness", Level.OK)
        return failed and folder.takes(self._directory)

    def _check(self) -> None:
        folder.check_mounted(self._mount)
        folder.make(self._directory)
        folder.check_inodes(self._directory)
        self._space.check()
