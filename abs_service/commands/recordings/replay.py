"""Tracks a recording again: every frame set without a drop, the same estimates each time; writes them to a new file.

  abs-service replay recordings/x.mcap                          with the configuration that it was recorded with
  abs-service replay recordings/x.mcap --config rig.toml        with another one
  abs-service replay recordings/x.mcap --images                 with the images, to view both or make a film
  abs-service replay recordings/x.mcap --json > estimates.jsonl one JSON object per estimate, for scripts
  abs-service replay recordings/x.mcap --picture first.png      draws what will be tracked first
  abs-service replay recordings/x.mcap --speed 1                in real time, through the processes of `run`

The configuration's devices are not opened. Cameras come from the recording, unless the configuration has its own.
Exit code 1 if a tracker tracked nothing.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

from rich.progress import Progress

from abs_service import config, wiring
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands import run as run_command
from abs_service.commands.parts import preview_option, progress
from abs_service.commands.parts.log import logs
from abs_service.commands.parts.options import OptionError, check_new, number
from abs_service.commands.parts.recorded_rig import draw_previews, recorded_rig
from abs_service.commands.parts.rig_in_memory import in_memory
from abs_service.commands.recordings.image_copies import image_copies
from abs_service.commands.running import outcome
from abs_service.supervision.exit_codes import Exit
from abs_service.tracking.replay import OfflineTracker, free_path, replay
from abs_service.tracking.session import TrackingSession
from drivers.encoding.mcap_file import McapFile
from drivers.replay import Recording

#: Type of --speed, with the limits of a played recording.
SPEED = number(0.01, 100.0, "a number from 0.01 to 100")
#: Time that the processes of a live replay have to get ready before its first frame [s].
START_S = 6.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service replay`."""
    parser.add_argument("recording", metavar="FILE", type=Path, help="recording to track")
    parser.add_argument("--config", metavar="RIG", type=Path, help="TOML file (default: the one in the recording)")
    parser.add_argument("--out", metavar="PATH", type=Path, help="file to write; with --speed the folder")
    parser.add_argument("--images", action="store_true", help="write the images as well, for `view` and films")
    parser.add_argument("--speed", metavar="X", type=SPEED, help="play live, X times as fast as it was recorded")
    parser.add_argument("--json", action="store_true", help="print one JSON object per estimate, no progress bar")
    preview_option.add_argument(parser)


def run(arguments: argparse.Namespace) -> int:
    """Replays a recording, offline or live."""
    recording = Recording(arguments.recording)
    for note in notes(recording):
        print(f"abs-service: note: {note}", file=sys.stderr)
    settings = configuration(recording, arguments.config)
    if arguments.picture:
        for line in draw_previews(settings, recording, arguments.picture):
            print(line, file=sys.stderr if arguments.json else sys.stdout, flush=True)
    if arguments.speed is not None:
        if arguments.images:
            raise OptionError("--images: with --speed, --out FOLDER records the images; leave out --images")
        return _live(settings, arguments)
    out = arguments.out or free_path(arguments.recording)
    active = check_new(out, "--out" if arguments.out else "")
    with _writing(out, active, config.to_toml(settings)) as file, progress.bars(disable=arguments.json) as bars:
        headers = _headers(settings, recording)
        trackers = {name: _tracker(settings, name, recording, headers, file) for name in settings.trackers}
        cameras = recording.cameras | wiring.cameras(settings, recording.cameras)
        images = image_copies(recording, cameras, headers, file) if arguments.images else iter(())
        _run_through(recording, trackers, images, bars, arguments.json)
    output = sys.stderr if arguments.json else sys.stdout
    for name, tracker in trackers.items():
        print(*(f"{name}: {line}" for line in [*tracker.log.summary(), *_unused(tracker)]), sep="\n", file=output)
    if recording.malformed:
        print(f"{recording.malformed} frames cannot be decoded and were left out", file=output)
    if recording.unpaired:
        print(f"{recording.unpaired} images or descriptions without their counterpart", file=output)
    print(f"wrote {out}", file=output)
    return Exit.FAILED if outcome.untracked({name: tracker.log for name, tracker in trackers.items()}) else Exit.OK


def notes(recording: Recording) -> list[str]:
    """Notes on truncation and damage of a recording, and on cameras that do not stay the same."""
    path, found = recording.path, list[str]()
    if recording.truncated:
        found.append(f"{path} was never finished; what follows is up to where it breaks off")
    if recording.damaged_chunks:
        found.append(f"{path}: {recording.damaged_chunks} damaged chunks are left out; their images are missing")
    if recording.recalibrated:
        sensors = ", ".join(recording.recalibrated)
        found.append(f"{path}: another calibration of {sensors} follows within it; the first one is used throughout")
    return found


def configuration(recording: Recording, path: Path | None) -> config.ServiceConfig:
    """The configuration to replay with.

    Raises:
        OptionError: none is given and the recording holds none, or it has no tracker.
    """
    if path is None and not recording.config:
        writes = f"`abs-service new rig.toml --recording {recording.path}` writes one"
        raise OptionError(f"{recording.path}: no configuration is in this recording; name one with --config; {writes}")
    source = f"{recording.path} (rig.toml)"
    base = recording.path.resolve().parent
    settings = config.load(path) if path else config.loads(recording.config, source, base)
    if not settings.trackers:
        raise OptionError(f"{path or source}: trackers: there is none, so there is nothing to do")
    return settings


def _headers(settings: config.ServiceConfig, recording: Recording) -> HeaderFactory:
    clock = WallClock(monotonic=lambda: 0, wall=lambda: recording.wall_offset_ns)
    return HeaderFactory(settings.name, clock, boot_id="replay")


def _tracker(
    settings: config.ServiceConfig, name: str, recording: Recording, headers: HeaderFactory, file: McapFile
) -> OfflineTracker:
    rig, synchroniser = recorded_rig(settings, name, recording)
    return OfflineTracker(
        name,
        TrackingSession(rig, wiring.plan(settings, name)),
        synchroniser,
        wiring.model_name(settings, name),
        rig.calib_id,
        headers,
        file,
        time.monotonic_ns,
    )


def _unused(tracker: OfflineTracker) -> list[str]:
    """A line about frames that were lost on the way; streams that the tracker does not ask for are none."""
    found = tracker.synchroniser.counters.items()
    counters = {name: number for name, number in found if not name.endswith(".unexpected")}
    return [f"frames in no set: {', '.join(f'{name} {n}' for name, n in counters.items())}"] if counters else []


def _run_through(
    recording: Recording,
    trackers: dict[str, OfflineTracker],
    images: Iterator[None],
    bars: Progress,
    as_json: bool,
) -> None:
    task = bars.add_task("images", total=sum(recording.counts.values()))
    for _, report in replay(recording, trackers):
        if report is None:
            next(images, None)
            bars.advance(task)
        elif as_json:
            print(json.dumps(report.as_dict(), ensure_ascii=False), flush=True)
        else:
            error = "" if report.error_mm is None else f", error {report.error_mm:.2f} mm"
            bars.update(task, description=f"{report.tracker} {report.status}{error}")
    for _ in images:
        pass


@contextmanager
def _writing(path: Path, active: Path, toml: str) -> Iterator[McapFile]:
    """A new MCAP file, `active` until it is complete; an error leaves none, an interruption what there is."""
    try:
        stream = active.open("wb")
    except OSError as error:
        raise OptionError(f"--out {path}: cannot be written: {error.strerror}") from None
    file = None
    try:
        with stream:
            file = McapFile(stream)
            file.attach("rig.toml", "text/toml", toml.encode(), 0)
            yield file
            file.finish()
    except Exception as error:
        active.unlink()
        if isinstance(error, OSError) and file is not None and file.failure:  # not of standard output
            raise OptionError(f"--out {path}: cannot be written: {error.strerror}") from None
        raise
    os.replace(active, path)


def _live(settings: config.ServiceConfig, arguments: argparse.Namespace) -> int:
    """Plays the recording as the only device of the rig, through `run`."""
    recording_uri = f"replay://{quote(str(arguments.recording.resolve()))}?speed={arguments.speed:g}&delay={START_S:g}"
    with in_memory(_played(settings, recording_uri), config.named(arguments.config or arguments.recording)) as file:
        options = ["--json"] if arguments.json else []
        options += ["--out", str(arguments.out)] if arguments.out else ["--no-record"]
        parser = argparse.ArgumentParser()
        run_command.add_arguments(parser)
        logs.add_arguments(parser)
        return run_command.run(parser.parse_args([str(file.path), *options, *logs.options(arguments)]))


def _played(settings: config.ServiceConfig, uri: str) -> config.ServiceConfig:
    """The configuration with the device `uri` in place of all others."""
    table = next(iter(settings.devices.values())).model_copy(update={"uri": uri})
    sensors = {
        name: sensor.model_copy(update={"device": "recording", "head": name})
        for name, sensor in settings.sensors.items()
    }
    return settings.model_copy(update={"devices": {"recording": table}, "sensors": sensors})
