"""Monitors the disk: deletes old recordings and forecasts the time until it is full."""

import logging
import shutil
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

from abs_service.bus import stamps
from abs_service.bus.health import Health, Level
from abs_service.bus.stamps import WallClock
from abs_service.recording.disk import forecast
from abs_service.recording.disk.retention import Ages, Retention

_log = logging.getLogger(__name__)

#: Time between two checks of the rate of recording [s].
CHECK_S = 1.0
#: Time between two checks of the files [ns].
PERIOD_NS = 10_000_000_000
#: Least pause after it, by the time that it took.
PAUSE_FACTOR = 20
#: Room below which health warns [s].
WARN_S = 3600.0


class DiskMonitor:
    """Applies retentions and publishes a forecast, both in the recorder's health.

    Args:
        recordings: which of these are kept.
        estimates: which of the files that have the estimates alone.
        minimum_free_bytes: free space at which recording stops [bytes].
        health: of the recorder.
        clock: time.
        free_bytes: free space of the file system of a folder.
        is_synchronised: whether the wall clock follows a time server.
    """

    def __init__(
        self,
        recordings: Retention,
        estimates: Retention,
        minimum_free_bytes: int,
        health: Health,
        clock: WallClock,
        free_bytes: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free,
        is_synchronised: Callable[[], bool] = stamps.is_synchronised,
    ) -> None:
        self._recordings = recordings
        self._estimates = estimates
        self._minimum_free_bytes = minimum_free_bytes
        self._health = health
        self._clock = clock
        self._free_bytes = free_bytes
        self._meters = forecast.RateMeter(), forecast.RateMeter()
        self._ages = [Ages(clock.wall, kept.retain_s, is_synchronised) for kept in (recordings, estimates)]
        self._next_ns = 0

    def start(self, written: Callable[[], tuple[int, int]], stop: threading.Event) -> None:
        """Starts a thread that checks periodically: 100,000 recordings take seconds, and a disk may not answer.

        Args:
            written: see `check`.
            stop: ends it.
        """

        def follow() -> None:
            while not stop.wait(CHECK_S):
                try:
                    self.check(written())
                except Exception as error:  # our own mistake, which must not end retention without a word
                    _log.exception("the disk is not monitored")
                    self._health.report("retention", Level.ERROR, f"{type(error).__name__}: {error}")

        threading.Thread(target=follow, name="disk monitor", daemon=True).start()

    def check(self, written: tuple[int, int]) -> None:
        """Applies the retentions and updates the forecast every ten seconds, less often where that takes long.

        Args:
            written: bytes so far, to all recordings and to all files of estimates.
        """
        now_ns = self._clock.monotonic()
        rates = [meter.add(now_ns, total) for meter, total in zip(self._meters, written, strict=True)]
        if now_ns < self._next_ns:
            return
        self._delete(now_ns)
        try:
            self._forecast(*rates)
        except OSError:  # no folder; the recorder says so
            self._health.label("forecast", "")
        after_ns = self._clock.monotonic()
        self._next_ns = max(now_ns + PERIOD_NS, after_ns + PAUSE_FACTOR * (after_ns - now_ns))

    def _delete(self, now_ns: int) -> None:
        warning = ""
        for kept, ages in zip((self._recordings, self._estimates), self._ages, strict=True):
            deleted, failures = kept.apply(partial(ages.of, now_ns=now_ns))
            for path in deleted:
                self._health.count("deleted")
                self._health.label("deleted", path.name)
            if ages.doubt:
                warning = f"{ages.doubt}, by a clock that follows no time server; what is older is kept for now"
            if failures:
                warning = f"an old recording cannot be deleted: {failures[0]}"
        self._health.report("retention", Level.WARNING if warning else Level.OK, warning)

    def _forecast(self, rate: float, estimates_rate: float) -> None:
        room = self._free_bytes(self._recordings.directory) - self._minimum_free_bytes
        recordings, estimates = self._recordings.growth(rate), self._estimates.growth(estimates_rate)
        self._health.label("forecast", forecast.text(recordings, estimates, room))
        seconds = forecast.room_s((recordings, estimates), room)
        message = f"the disk is full in {forecast.duration(seconds)}" if seconds < WARN_S else ""
        self._health.report("room", Level.WARNING if message else Level.OK, message)
