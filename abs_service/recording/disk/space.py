"""Room on the disk of the recordings: recording ends before it is full."""

from collections.abc import Callable
from pathlib import Path

from abs_service.bus.health import Health

#: Free space at which recording resumes, relative to that at which it ended: or it would end again at once.
RESUME_FACTOR = 1.5


class Space:
    """Says how much may be written.

    Args:
        directory: of the recordings.
        minimum_free_bytes: that are left free on its disk [bytes].
        free_bytes: free space of the file system of a folder [bytes].
        health: of the recorder.
    """

    def __init__(
        self, directory: Path, minimum_free_bytes: int, free_bytes: Callable[[Path], int], health: Health
    ) -> None:
        self._directory = directory
        self._minimum = minimum_free_bytes
        self._free_bytes = free_bytes
        self._health = health
        self._is_short = False

    def left(self) -> int:
        """Bytes that may still be written; negative if recording has to end.

        Raises:
            OSError: the disk does not say.
        """
        free = self._free_bytes(self._directory)
        self._health.gauge("free_bytes", free)
        return free - self._minimum

    def check(self) -> None:
        """Checks that recording can begin; after it could not, only where more is free.

        Raises:
            OSError: there is no room, or the disk does not say.
        """
        left, resumes = self.left(), self._minimum * RESUME_FACTOR
        self._is_short = left < (resumes - self._minimum if self._is_short else 0)
        if self._is_short:
            free = f"only {max(left + self._minimum, 0) / 1e6:.0f} MB free in {self._directory}"
            limit = f"record.minimum_free_bytes is {self._minimum / 1e6:.0f} MB"
            raise OSError(f"{free}, {limit}; recording resumes with {resumes / 1e6:.0f} MB")
