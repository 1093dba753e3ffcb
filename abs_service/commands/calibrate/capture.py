"""Collects views of a board from the sensors of a rig for a calibration.

  abs-service calibrate capture rig.toml --target target.toml --out board.mcap
  abs-service calibrate capture rig.toml --target target.toml --out board.mcap --limit-s 120 --json

Hold the board still for a moment, change its pose, hold it still again. A map for each sensor shows where it has seen
the board, and the lines below say what is missing. It ends when nothing is, or with Ctrl-C.

A view is kept if the board holds still and shows something that the kept views do not. `left` and `right` are those of
the sensor's image, and the board faces where its print does.

Writes the recording OUT, from which the other commands calibrate, the corners it found (OUT.corners.npz), from which
`rig` and `intrinsics` do, too, and a picture OUT-SENSOR.png of what each sensor has seen: where it is red, it has not
seen the board. Without a view, it writes nothing. Exit code 0: enough; 1: ended before it was enough; 2: of no use.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

import cv2
from rich.console import Console

from abs_service import config
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.calibration.files import corner_file, target_file
from abs_service.calibration.shots.collection import Collector
from abs_service.calibration.shots.corner_extraction import see
from abs_service.calibration.shots.guide import Guide, LineGuide, LiveGuide, coverage_map
from abs_service.calibration.shots.live_shots import LiveShots, NamedDevice
from abs_service.calibration.shots.shot_recording import ShotFileError, ShotRecording
from abs_service.calibration.shots.shots import SOUGHT, Shot
from abs_service.commands.parts import rig_devices, rig_process
from abs_service.commands.parts.options import check_new
from abs_service.report.content import Level
from calib.board.target import Target
from calib.camera import Camera
from drivers.opening import open_device

#: Minimum interval between kept shots [ns]; recordings are sampled at the same rate.
PAUSE_NS = 600_000_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service calibrate capture`."""
    parser.add_argument("config", metavar="RIG", type=Path, help="TOML file of the rig")
    parser.add_argument("--target", type=Path, required=True, metavar="FILE", help="description of the board")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.mcap", help="recording; must not exist")
    parser.add_argument(
        "--limit-s",
        type=rig_process.seconds,
        default=rig_process.MAX_DURATION_S,
        metavar="S",
        help="longest time (no limit)",
    )
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")


def run(arguments: argparse.Namespace) -> int:
    """Collects views until they are sufficient."""
    rig = rig_process.load_config(arguments)
    target = target_file.read(arguments.target)
    check_new(arguments.out, "--out")
    stop = rig_process.stop_on_signals()
    end_ns = time.monotonic_ns() + arguments.limit_s * 1e9
    console = Console(stderr=True)
    with opened(rig, arguments.config) as (devices, cameras):
        headers = HeaderFactory(rig.name, WallClock())
        shots = LiveShots(
            devices,
            cameras,
            round(rig.synchronisation.tolerance_ms * 1e6),
            time.monotonic_ns,
            lambda: stop.is_set() or time.monotonic_ns() > end_ns,
        )
        collector = Collector(_sizes(devices))
        recording = ShotRecording(arguments.out, headers, cameras, config.to_toml(rig))
        guide = LiveGuide(console) if console.is_terminal else LineGuide(console)
        try:
            with shots, guide:
                _collect(target, shots, cameras, collector, recording, guide, arguments.out)
        finally:
            recording.finish()
    if collector.kept:
        corner_file.write(collector.seen, corner_file.path_beside(arguments.out))
    return _conclude(collector, arguments)


@contextmanager
def opened(rig: config.ServiceConfig, path: Path) -> Iterator[tuple[dict[str, NamedDevice], dict[str, Camera]]]:
    """Opens and configures the devices of a rig file; yields them with their cameras, and closes them afterwards.

    Raises:
        DeviceError: one cannot be opened.
        SettingError, HeadError: the file names a control or a head that a device lacks.
    """
    devices: dict[str, NamedDevice] = {}
    cameras: dict[str, Camera] = {}
    with ExitStack() as stack:
        for name in rig.devices:
            device = open_device(rig.devices[name].uri, time.monotonic_ns)
            stack.callback(device.close)
            rig_devices.set_controls(device, rig.devices[name].controls, f"{path}: devices.{name}.controls")
            devices[name] = NamedDevice(device, rig.heads(name))
            cameras |= rig_devices.cameras(rig, name, device)
        yield devices, cameras


def _collect(
    target: Target,
    shots: LiveShots,
    cameras: Mapping[str, Camera],
    collector: Collector,
    recording: ShotRecording,
    guide: Guide,
    out: Path,
) -> None:
    kept_ns: int | None = None
    for shot in shots:
        if kept_ns is not None and shot.t_ns - kept_ns < PAUSE_NS:
            continue
        is_kept = collector.take(see(target, shot, cameras))
        if is_kept:
            kept_ns = shot.t_ns
            recording.write(shot)
            _picture(shot, collector, out)
        guide.update(collector, is_kept)
        if not collector.missing_views:
            return


def _sizes(devices: Mapping[str, NamedDevice]) -> dict[str, tuple[int, int]]:
    """Width and height of the images for corner detection, by rig name [px]."""
    return {
        wired.heads[stream.sensor]: (stream.width, stream.height)
        for wired in devices.values()
        for stream in wired.device.capabilities.streams
        if stream.sensor in wired.heads and stream.kind in SOUGHT
    }


def _picture(shot: Shot, collector: Collector, out: Path) -> None:
    for sensor, look in shot.sensor_shots.items():
        if look.image.size:
            views = [view for view in collector.views if view.sensor == sensor]
            path = _picture_path(out, sensor)
            if not cv2.imwrite(str(path), coverage_map(look.image, views)):
                raise ShotFileError(f"{path}: cannot be written")


def _picture_path(out: Path, sensor: str) -> Path:
    return out.with_name(f"{out.stem}-{sensor}.png")


def _conclude(collector: Collector, arguments: argparse.Namespace) -> int:
    problem, missing_views = collector.problem(), collector.missing_views
    level = Level.BAD if problem else Level.DOUBTFUL if missing_views else Level.GOOD
    poses = collector.poses
    if arguments.json:
        missing = [{"sensor": missing.sensor, "text": missing.text} for missing in missing_views]
        found = {"verdict": str(level), "exit_code": int(level), "shots": collector.kept, "poses": poses}
        recording = str(arguments.out) if collector.kept else None
        print(json.dumps({**found, "problem": problem, "missing": missing, "recording": recording}))
        return int(level)
    counts = ", ".join(f"{number} of {sensor}" for sensor, number in poses.items())
    kept = f"{collector.kept} shots; distinct poses: {counts}" if collector.kept else "not written, without a shot"
    print(f"{arguments.out}: {kept}")
    if problem:
        print(f"No calibration can be made of this. {problem}", file=sys.stderr)
    for missing in missing_views:
        print(f"missing: {missing.sensor}: {missing.text}", file=sys.stderr)
    return int(level)
