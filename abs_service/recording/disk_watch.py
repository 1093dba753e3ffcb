"""Looks after the disk: deletes old recordings and says how long there is room."""

import shutil
from collections.abc import Callable
from pathlib import Path

from abs_service.bus.health import Health, Level
from abs_service.bus.stamps import WallClock
from abs_service.recording import forecast
from abs_service.recording.retention import Retention

#: Time between two looks [ns].
PERIOD_NS = 10_000_000_000
#: Room below which health warns [s].
WARN_S = 3600.0
#: Change of the wall clock after which nothing is deleted by its age until the process starts again [ns].
STEP_NS = 86_400_000_000_000


class DiskWatch:
    """Applies a retention and publishes a forecast, both in the recorder's health.

    Args:
        retention: what is kept.
        minimum_free_bytes: free space at which recording stops [bytes].
        health: of the recorder.
        clock: time.
        free_bytes: free space of the file system of a folder.
    """

    def __init__(
        self,
        retention: Retention,
        minimum_free_bytes: int,
        health: Health,
        clock: WallClock,
        free_bytes: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free,
    ) -> None:
        self._retention = retention
        self._minimum_free_bytes = minimum_free_bytes
        self._health = health
        self._clock = clock
        self._free_bytes = free_bytes
        self._meter = forecast.RateMeter()
        self._offset_ns = clock.wall(0)
        self._next_ns = 0

    def look(self, written_bytes: int) -> None:
        """Does both every ten seconds.

        Args:
            written_bytes: what has been written so far, to all files.
        """
        now_ns = self._clock.monotonic()
        rate = self._meter.add(now_ns, written_bytes)
        if now_ns < self._next_ns:
            return
        self._next_ns = now_ns + PERIOD_NS
        self._delete(now_ns)
        try:
            self._forecast(rate)
        except OSError:  # no folder; the recorder says so
            self._health.label("forecast", "")

    def _delete(self, now_ns: int) -> None:
        # A wall clock that jumps years ahead makes all recordings old.
        is_steady = abs(self._clock.wall(0) - self._offset_ns) < STEP_NS
        try:
            deleted = self._retention.apply(self._clock.wall(now_ns) if is_steady else 0)
        except OSError as error:
            self._health.report("retention", Level.WARNING, f"an old recording cannot be deleted: {error}")
            return
        self._health.report("retention", Level.OK)
        for path in deleted:
            self._health.count("deleted")
            self._health.label("deleted", path.name)

    def _forecast(self, rate: float) -> None:
        kept = self._retention
        room = self._free_bytes(kept.directory) - self._minimum_free_bytes
        used = sum(file.size for file in kept.files())
        numbers = (rate, room, used, kept.retain_s, kept.retain_bytes)
        self._health.label("forecast", forecast.text(*numbers))
        seconds = forecast.room_s(*numbers)
        message = f"the disk is full in {forecast.duration(seconds)}" if seconds < WARN_S else ""
        self._health.report("room", Level.WARNING if message else Level.OK, message)
