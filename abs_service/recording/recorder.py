"""Records all messages of a rig, images as configured; reports losses and failures in its health."""

import logging
import shutil
import threading
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from abs_service.bus.contract import Bus, Sample
from abs_service.bus.health import Health, Level
from abs_service.bus.queues import BoundedQueue
from abs_service.bus.stamps import WallClock
from abs_service.recording.disk.backoff import Backoff
from abs_service.recording.disk.readiness import Readiness
from abs_service.recording.disk.space import Space
from abs_service.recording.disk.stall import DiskStall
from abs_service.recording.losses import Losses
from abs_service.recording.recorder_settings import RecorderSettings
from abs_service.recording.recording_file import free_path, open_for_writing
from abs_service.recording.sample_writer import SampleWriter
from abs_service.recording.take import Take
from abs_service.recording.triggers.pre_roll import PreRoll
from abs_service.recording.triggers.trigger import ALWAYS, Trigger

_log = logging.getLogger(__name__)

#: Timeout of the queries at the start [s].
QUERY_S = 1.0
#: Longest time between two checks of the disk, of the place of the open file, and of its size and age [s].
POLL_S = 1.0
#: Time between two attempts to record after a failure [s].
RETRY_S = 1.0
#: Time between two checks whether there is something to record [s].
IDLE_S = 0.05
#: Why a file ends when the trigger does.
ENDED = "trigger"


class Recorder:
    """Writes all messages of a rig to MCAP files, from a thread of its own.

    An error of the disk ends a file: what was written stays, as `*.mcap.active`, for `recovery`. Health says
    RECORD_FAILED until a further file, begun as soon as the disk takes one, has been flushed. Messages wait in the
    queue meanwhile; what it does not hold is dropped and counted.

    Args:
        bus: the rig.
        settings: where and how.
        health: of this component.
        clock: stamps messages without a stamp and measures ages.
        open_file: creates a file; a test may give a slow or full one.
        free_bytes: free space of the file system of a folder.
        retry_s: shortest time between two attempts after a failure [s].
        trigger: when to record.
    """

    def __init__(
        self,
        bus: Bus,
        settings: RecorderSettings,
        health: Health,
        clock: WallClock,
        open_file: Callable[[Path], BinaryIO] = open_for_writing,
        free_bytes: Callable[[Path], int] = lambda directory: shutil.disk_usage(directory).free,
        retry_s: float = RETRY_S,
        trigger: Trigger = ALWAYS,
    ) -> None:
        self._bus = bus
        self._settings = settings
        self._health = health
        self._clock = clock
        self._open_file = open_file
        self._space = Space(settings.directory, settings.minimum_free_bytes, free_bytes, health)
        self._queue: BoundedQueue[Sample] = BoundedQueue(settings.queue_bytes + settings.pre_roll_bytes)
        self._writer = SampleWriter(settings.encode_image, health, clock)
        self._pre_roll = PreRoll(
            self._queue,
            trigger,
            settings.pre_roll_s,
            settings.pre_roll_bytes,
            clock.monotonic,
            lambda sample: self._writer.latch([sample]),
        )
        self._stopping, self._failed = threading.Event(), ""
        self._readiness = Readiness(settings.directory, self._space, health, clock.monotonic)
        self._losses = Losses(health, clock.monotonic)
        self.stall = DiskStall(health, clock.monotonic, lambda: self._queue.size)
        self._backoff = Backoff(settings.directory, retry_s, self._stopping.wait, self.stall.alive)
        self._finished, self.failures = (0, 0), 0
        self.arrived = 0  # messages, of all kinds
        self.written = (0, 0)  # bytes to all recordings, and to all files of estimates
        self._thread = threading.Thread(target=self._run, name="record", daemon=True)

    @property
    def failed(self) -> str:
        """Reason why recording has failed; "" if it works. `failures` counts the failures."""
        return self._failed

    def start(self) -> None:
        """Subscribes and begins to write."""
        self._subscription = self._bus.subscribe("**", self._receive)
        # Only now, so that nothing falls between the answers and the subscription.
        self._writer.latch(self._bus.query("**", QUERY_S))
        self._thread.start()

    def ask(self, recording: bool) -> str:
        """Begins, with the pre-roll, or ends on a command; returns the reason for a refusal, "" if accepted."""
        return self._pre_roll.ask(recording)

    def stop(self, timeout_s: float) -> None:
        """Writes the queue and finishes the file; gives up after `timeout_s`, which leaves it to be recovered."""
        self._subscription.close()
        self._losses.settle()
        self._queue.close()
        self._stopping.set()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            self._fail(f"the disk did not take within {timeout_s:g} s what waited")

    def report(self) -> None:
        """Updates the counters and gauges of health; call it before `Health.tick`."""
        self._health.gauge("queue_bytes", self._queue.size)
        self._pre_roll.report(self._health)
        self._losses.report(self._queue.dropped, bool(self._failed))
        self._writer.ask_for_missing(self._bus)

    def _receive(self, sample: Sample) -> None:
        self.arrived += 1
        self._losses.arrive(sample)
        self._pre_roll.put(sample)

    def _run(self) -> None:
        while not self._queue.is_drained:
            self.stall.alive()
            if not self._queue.size and not self._pre_roll.is_open:
                if self._readiness.look(bool(self._failed)):
                    self._recover("the disk takes recordings again")
                self._stopping.wait(IDLE_S)
                continue
            if self._attempt():
                continue
            if self._stopping.is_set():
                break
            self._backoff.pause()
        self._queue.drop_all()

    def _attempt(self) -> bool:
        """Records one file; False if the disk is to be left alone for a while."""
        try:
            self._readiness.check()
            self._record_one_file()
        except OSError as error:
            self._fail(str(error))
            return False
        except Exception as error:  # our own mistake, which must neither go unnoticed nor end recording
            _log.exception("the recorder failed")
            self._fail(f"{type(error).__name__}: {error}")
            return False
        return True

    def _record_one_file(self) -> None:
        settings, started_ns = self._settings, self._clock.monotonic()
        wall_ns = self._clock.wall(started_ns)
        take = Take(
            free_path(settings.directory, settings.name, wall_ns),
            settings.estimates,
            wall_ns,
            {"rig.toml": settings.rig_toml},
            settings.compression,
            settings.chunk_bytes,
            self._open_file,
        )
        self._backoff.left += 1
        self._readiness.begun()
        self._finished = self.written
        self._health.label("file", take.path.name)
        self._health.count("files")
        try:
            self._writer.begin(take)
            reason = self._fill(take, started_ns)
            fate = take.fate
            if reason == ENDED:
                self._writer.pause()
                self._health.label("file", "")
            take.finish({"ended": reason, **self._writer.summary(self._queue.dropped)})
        except BaseException:
            self._health.label("file", take.abandon().name)
            self._health.count("unsaved", self._writer.unsaved)
            raise
        if fate:
            self._health.label("file", "")
            raise OSError(f"{fate} while it was written")
        self._keep(take)

    def _fill(self, take: Take, started_ns: int) -> str:
        """Records until a reason to end the file, which is returned."""
        settings, flush_ns = self._settings, int(self._settings.flush_s * 1e9)
        poll_ns = min(flush_ns, int(POLL_S * 1e9))
        next_flush_ns, next_poll_ns, next_poll_size = started_ns + flush_ns, started_ns + poll_ns, 0
        while True:
            self.stall.alive()
            sample = self._queue.take(max(0.0, (next_poll_ns - self._clock.monotonic()) / 1e9))
            if sample is not None:
                self._writer.write(take, sample)
            elif self._queue.is_drained:
                return "stopped"
            elif not self._pre_roll.is_open:
                return ENDED
            now_ns = self._clock.monotonic()
            if now_ns < next_poll_ns and take.size < next_poll_size:
                continue
            next_poll_ns = now_ns + poll_ns
            if take.fate:
                return "gone"
            if now_ns >= next_flush_ns:
                next_flush_ns = now_ns + flush_ns
                take.flush()
                self._keep(take)
            room = self._space.left()
            if room < 0:
                return "low space"
            # What has waited in memory may fill a disk within a second.
            next_poll_size = min(take.size + room // 2, settings.rotate_bytes)
            if take.size >= settings.rotate_bytes or now_ns - started_ns >= settings.rotate_s * 1e9:
                return "rotated"

    def _keep(self, take: Take) -> None:
        """Notes that the disk has what was written so far."""
        self._writer.saved()
        self._backoff.left = 0
        self._health.gauge("file_bytes", take.size)
        self.written = (self._finished[0] + take.size, self._finished[1] + take.estimates_size)
        if self._failed:
            self._recover(f"recording again, to {take.path.name}")

    def _recover(self, how: str) -> None:
        _log.warning("%s", how)
        self._failed = ""
        self._health.report("record", Level.OK)

    def _fail(self, reason: str) -> None:
        is_new = not self._failed
        if is_new:
            _log.error("RECORD_FAILED %s", reason)
        self._health.count_up_to({"failures": self.failures + is_new})
        self._health.label("last_failure", reason)
        self._health.report("record", Level.ERROR, f"RECORD_FAILED {reason}")
        self._failed = reason
        self.failures += is_new  # last, so that who sees it also finds the reason
