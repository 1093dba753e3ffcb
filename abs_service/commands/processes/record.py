"""Records everything that a rig publishes to MCAP files, until SIGTERM or Ctrl-C.

  abs-service record rig.toml                                  of the rig that `abs-service run rig.toml` drives
  abs-service record rig.toml --connect tcp/192.168.1.7:7447   of the same rig on another host

A file is called *.mcap.active until it is complete. What a crash leaves is recovered at the next start. Exit code 1 if
recording failed at any time (docs/reference/reliability.md).
"""

import argparse
import errno
import logging
import os
import shutil
import threading
import time
from contextlib import suppress
from pathlib import Path

from abs_service import config
from abs_service.bus.health import Health, Level
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.parts import disk, rig_process
from abs_service.recording.disk.disk_monitor import DiskMonitor
from abs_service.recording.recorder import Recorder
from abs_service.recording.recorder_settings import RecorderSettings
from abs_service.recording.recovery import InUseError, RecoveryError, leftovers, recover, remove_interrupted, set_aside
from abs_service.recording.triggers.first_tracking import FirstTracking
from abs_service.recording.triggers.trigger import ALWAYS, RequestTrigger, Trigger
from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.process_setup import process_tuning
from abs_service.wire import commands
from calib.files import limited
from drivers.encoding import encoded_image
from drivers.encoding.encoded_image import ImageCodec
from drivers.encoding.mcap_file import Compression

_log = logging.getLogger(__name__)

#: Time to drain the queue at the end [s].
DRAIN_S = 2.5
#: Time without a message after which none is on its way any more, and the longest wait for that at the end [s].
QUIET_S, LAST_S = 0.2, 1.0
#: Age of an unfinished file below which the recorder before this one was killed while it recorded [s].
INTERRUPTED_S = 60.0
#: Time between two checks whether something is to be recovered [s].
RECOVERY_S = 10.0
#: Largest lag of a file system's clock, which has the time of the last tick of the system [s].
TICK_S = 0.1
#: Niceness: capture and tracking go first where cores are scarce; recording has a queue.
NICE = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service record`."""
    rig_process.add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Records until SIGTERM or SIGINT."""
    rig = rig_process.load_config(arguments)
    settings = _settings(rig)
    stop = rig_process.stop_on_signals()
    clock = WallClock()
    headers = HeaderFactory(rig.name, clock)
    with rig_process.open_bus(rig, arguments, "recorder") as bus:
        health = Health(bus, "record", headers)
        bus.declare_liveliness("record")
        trigger = make_trigger(rig, clock)
        recorder = Recorder(bus, settings, health, clock, trigger=trigger)
        # In parallel: it may take minutes, and the disk may not answer.
        context = recorder, settings, health, stop, time.time()
        recovery = threading.Thread(target=recover_again_and_again, args=context, name="recovery", daemon=True)
        os.nice(NICE)  # this thread and those that it starts from now on: not those that receive
        tracking = FirstTracking(bus, rig.trackers)
        if rig.record.begin == "tracking":
            recovery.start()
            _wait_for_tracking(tracking, health, stop)
        if stop.is_set():
            return Exit.OK
        recorder.start()
        if recovery.ident is None:  # not earlier: it would take the time in which nothing is recorded
            recovery.start()
        commands.answer_record(bus, headers, health, recorder.ask)
        process_tuning.freeze_loaded_objects()
        monitor = DiskMonitor(disk.recordings(rig), disk.estimates(rig), settings.minimum_free_bytes, health, clock)
        monitor.start(lambda: recorder.written, stop)
        while not stop.wait(0.2):
            recorder.stall.report()
            health.label("tracking", "" if tracking.seen.is_set() else "nothing is tracked yet")
            if health.due():
                clock.measure()
                recorder.report()
                bus.report(health)
                health.tick()
        _end(recorder)
        health.publish()
    return Exit.FAILED if recorder.failures else Exit.OK


def _end(recorder: Recorder) -> None:
    """Ends a recorder when what was sent before has arrived, which takes longer if it stood still."""
    now_s, arrived = time.monotonic(), -1
    quiet_s = last_s = now_s + LAST_S
    while now_s < min(quiet_s, last_s):
        if recorder.arrived != arrived:
            arrived, quiet_s = recorder.arrived, now_s + QUIET_S
        time.sleep(0.01)
        now_s = time.monotonic()
    recorder.stop(DRAIN_S)
    recorder.report()


def _wait_for_tracking(tracking: FirstTracking, health: Health, stop: threading.Event) -> None:
    health.label("tracking", "begins when something is tracked")
    while not (stop.is_set() or tracking.seen.wait(0.05)):
        health.tick()


def _settings(rig: config.ServiceConfig) -> RecorderSettings:
    table = rig.record
    return RecorderSettings(
        directory=table.directory,
        name=rig.name,
        rig_toml=config.to_toml(rig),
        encode_image=encoded_image.encoder(ImageCodec(table.depth_codec), ImageCodec(table.color_codec)),
        compression=Compression(table.compression),
        chunk_bytes=table.chunk_bytes,
        flush_s=table.flush_s,
        rotate_bytes=table.rotate_bytes,
        rotate_s=table.rotate_s,
        minimum_free_bytes=table.minimum_free_bytes,
        pre_roll_s=table.pre_roll_s,
        pre_roll_bytes=0 if table.when == "always" else table.pre_roll_bytes,
        estimates=table.estimates,
        queue_bytes=table.queue_bytes,
    )


def make_trigger(rig: config.ServiceConfig, clock: WallClock) -> Trigger:
    """The trigger that a rig asks for; one whose recording was interrupted a moment ago goes on."""
    table = rig.record
    if table.when == "always":
        return ALWAYS
    trigger = RequestTrigger(table.when == "not_tracking", table.post_roll_s, clock.monotonic)
    # Not one of the future: the wall clock was set back, and does not tell how old it is.
    if any(0 <= time.time() - changed_s < INTERRUPTED_S for changed_s in leftovers(table.directory).values()):
        trigger.resume()
    return trigger


def recover_again_and_again(
    recorder: Recorder, settings: RecorderSettings, health: Health, stop: threading.Event, begun_s: float
) -> None:
    """Recovers what recorders before this one have left, and later what it leaves itself when its disk fails.

    Retention deletes no unfinished file, but counts it: in months, they would take the room of all others.

    Args:
        recorder: whose failures leave files.
        settings, health, begun_s: see `recover_leftovers`.
        stop: ends it.
    """
    is_due, failures = not recover_leftovers(settings, health, begun_s), 0
    while not stop.wait(RECOVERY_S):
        if is_due and not recorder.failed:
            is_due = not recover_leftovers(settings, health, time.time() - RECOVERY_S / 2)
        if recorder.failures > failures:  # the next time, when what was left is old enough
            is_due, failures = True, recorder.failures


def recover_leftovers(settings: RecorderSettings, health: Health, begun_s: float) -> bool:
    """Recovers unfinished files of earlier recorders, as health and log tell; True if none is to be tried again.

    Args:
        settings: of the recorder.
        health: of the recorder.
        begun_s: Unix time [s]; what has been written since may be a file that somebody has not locked yet. What is of
            the future was written before the wall clock was set back, as by a start without a battery for the clock.
    """
    lacking = ""
    remove_interrupted(settings.directory)
    for path, changed_s in leftovers(settings.directory).items():
        try:
            if begun_s - TICK_S <= changed_s <= time.time() + TICK_S:
                continue
            _check_recoverable(path, settings)
            report = recover(path)
        except (InUseError, FileNotFoundError):  # another recorder's, which may have finished it
            continue
        except RecoveryError as error:  # it holds nothing
            _log.warning("not recovered: %s", error)
            with suppress(OSError):
                if path.stat().st_size:  # an empty one takes no room, and a recorder may have made it this moment
                    set_aside(path)  # else its size would count for ever, and recordings would be deleted for it
            continue
        except OSError as error:
            lacking = f"{path} cannot be recovered: {error.strerror}"
            continue
        health.count("recovered")
        health.label("recovered", str(report))
    health.report("recovery", Level.WARNING if lacking else Level.OK, lacking)
    return not lacking


def _check_recoverable(path: Path, settings: RecorderSettings) -> None:
    """Checks that nothing but its content keeps an unfinished recording from being recovered.

    Raises:
        OSError: something does, which may end.
    """
    if shutil.disk_usage(settings.directory).free < path.stat().st_size + settings.minimum_free_bytes:
        # Recording goes first: the copy must not take the room that it needs.
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with limited.opened(path):
        pass  # another user's, who alone may read it, is none that holds nothing
    if path.with_suffix("").exists():
        set_aside(path)  # it was recovered, and may not be removed by us: not copied again every ten seconds
        raise FileNotFoundError
