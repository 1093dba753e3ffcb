"""Fits a noise model of a depth sensor to recordings of static scenes, and writes it as a table for the rig file.

  abs-service calibrate noise white.mcap grey.mcap dark.mcap --distance-m 1.2    a flat target, 1.2 m away
  abs-service calibrate noise d*.mcap --distance-m 0.8 0.8 1.2 1.2 1.6 1.6       a distance for each recording
  abs-service calibrate noise b*.mcap --target board.toml                        a calibration board, anywhere
  abs-service calibrate noise desk.mcap --out desk                               whatever stands still
  abs-service calibrate noise oak://1944301 --distance-m 0.9                     live
  abs-service calibrate noise frames/ --camera camera.toml --depth 'd*.png'      a folder of images

Best are five distances over the range that you use and three materials (white, grey, dark), 60 frames of each: a flat
target that fills the image, its distance measured along the optical axis. Its tilt is found, and should be small. What
moves is left out. Without distances, planes are fitted; without planes, only the scatter in time is learnt; what could
not be determined is said.

With --target, a calibration board at rest is looked for in the mean image of each source: the sensor's own amplitude or
infrared image, or that of another sensor whose camera and pose are known. Its pose tells the real distances, as well as
the report says.

Writes OUT.toml (tables [sensors.NAME.noise] and, if a target tells how often returns are missing,
[sensors.NAME.no_return], to copy into the rig file), OUT.npz (maps of pixels, if they are worth
it), OUT.html and OUT.json (the report). The exit code is that of the verdict: 0 good; 1 doubtful, which
OUT.toml says, too; 2 bad, and only the report is written.
"""

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from abs_service.calibration.files import target_file, toml_text
from abs_service.calibration.noise import board_poses, measurement, repeated, report, sigma_consistency
from abs_service.calibration.shots import sequences
from abs_service.commands.calibrate.inputs import calibrations
from abs_service.commands.parts import camera_file
from abs_service.commands.parts.options import OptionError, check_folder, number, whole
from abs_service.commands.parts.progress import bars
from abs_service.config import plugins
from abs_service.report import page, provenance
from abs_service.report.content import Level, Report, to_json
from abs_service.supervision.exit_codes import Exit
from abs_service.tracker.detection.segments.within import load_mask
from calib.camera import Camera
from calib.files import atomic
from calib.noise.per_pixel import PerPixel
from calib.sequences.static_board import StaticBoard
from drivers.contract.frame import Geometry
from drivers.encoding.message_check import MAX_SIDE_PX
from drivers.image_folder.images import DepthImages, ImageFolder
from drivers.image_folder.listing import by_number

#: Seed of the random generator, for reproducible models.
SEED = 0

#: Metres per unit of the depth images of a folder whose camera file has no unit.
DEPTH_SCALE = 0.001

_PIXEL = whole(MAX_SIDE_PX - 1, "a column or row of an image")
_IMAGES = whole(1_000_000, "a number of images", 2)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service calibrate noise`."""
    parser.add_argument("sources", metavar="SOURCE", nargs="+", help="recording, folder of images or device address")
    parser.add_argument(
        "--distance-m", metavar="M", nargs="+", default=[math.nan],
        type=number(0.01, 1000, "a distance in metres, such as 1.2"),
        help="from the sensor to the target along the optical axis: one for all sources, or one for each",
    )  # fmt: skip
    parser.add_argument("--target", metavar="FILE", type=Path, help="board that tells its own distance, TOML")
    parser.add_argument(
        "--calibration", metavar="FILE", type=Path, help="calibration or rig file: cameras in place of the sources' own"
    )
    parser.add_argument("--sensor", metavar="NAME", default="", help="depth sensor (default: the only one)")
    parser.add_argument("--box", metavar="PX", nargs=4, type=_PIXEL, help="left, top, right, bottom of the target [px]")
    parser.add_argument("--mask", metavar="FILE", type=Path, help="image, black where the target is not")
    parser.add_argument(
        "--frames", metavar="N", type=_IMAGES, default=120, help="most frames of a source (%(default)d)"
    )
    parser.add_argument("--camera", metavar="FILE", type=Path, help="camera file of a folder, as for import")
    parser.add_argument("--depth", metavar="GLOB", default="depth_*.png", help="depth images of a folder (%(default)s)")
    parser.add_argument("--out", metavar="PATH", type=Path, help="files to write, without suffix (default: noise-NAME)")
    parser.add_argument("--json", action="store_true", help="print the report as one JSON object")


def run(arguments: argparse.Namespace) -> int:
    """Reads the sources, fits, writes and reports."""
    if arguments.out is not None:
        check_folder(arguments.out, "--out")
        page.check_replaceable(_out(arguments.out, "", 0))
    console = Console(stderr=True)
    with bars() as progress:
        task = progress.add_task("depth images", total=arguments.frames * len(arguments.sources))
        groups = _groups(arguments, lambda: progress.advance(task))
    paths = [Path(source) for source in arguments.sources if "://" not in source]
    paths += [path for path in (arguments.target, arguments.calibration) if path is not None]
    trace = provenance.trace(arguments.command_line, paths)
    worst = Exit.OK
    for index, (setting, given) in enumerate(groups.items()):
        group, said = repeated.counted_once(given)
        with console.status("learning") as status:
            found = measurement.calibrate(
                [one for one, _ in group],
                [where for _, where in group],
                _region(arguments, group[0][0].lengths.shape[1:]),
                np.random.default_rng(SEED),
                status.update,
            )
        sensor = group[0][0].sensor
        out = _out(arguments.out, sensor, index)
        made = report.report(
            sensor, found, tuple(c for one, _ in group for c in sigma_consistency.of_sequence(one)), trace, said
        )
        model = [] if made.level is Level.BAD else _write_model(found, sensor, out, made.level)
        written = [*model, *page.write(made, out)]
        _say(made, setting if len(groups) > 1 else "", written, arguments.json)
        worst = max(worst, int(made.level))
    return worst


def _groups(
    arguments: argparse.Namespace, advance: Callable[[], None]
) -> dict[str, list[tuple[sequences.Sequence, float | StaticBoard]]]:
    """Sequences of all sources by exposure setting, each with its target; calls `advance` for each depth image."""
    depths = _depths(arguments.distance_m, len(arguments.sources))
    if arguments.target is not None and not math.isnan(depths[0]):
        raise OptionError("--target, --distance-m: give only one of them; a board tells its own distance")
    target = None if arguments.target is None else target_file.read(arguments.target)
    cameras = _cameras(arguments.calibration)
    groups: dict[str, list[tuple[sequences.Sequence, float | StaticBoard]]] = {}
    for source, depth in zip(arguments.sources, depths):
        for one in _read(source, arguments, advance):
            seen = sequences.with_cameras(one, cameras)
            where = depth if target is None else board_poses.static_board(target, seen)
            groups.setdefault(seen.exposure, []).append((seen, where))
    return groups


def _depths(given: Sequence[float], sources: int) -> list[float]:
    if len(given) not in (1, sources):
        raise OptionError(f"--distance-m: {len(given)} distances for {sources} sources; give one, or one for each")
    return list(given) if len(given) == sources else list(given) * sources


def _cameras(path: Path | None) -> dict[str, Camera]:
    """Cameras of a calibration or rig file, by sensor."""
    return {} if path is None else {name: each.camera for name, each in calibrations.load(path).sensors.items()}


def _read(source: str, arguments: argparse.Namespace, advance: Callable[[], None]) -> list[sequences.Sequence]:
    path = Path(source)
    if "://" in source:
        return sequences.of_device(source, arguments.sensor, arguments.frames, time.monotonic_ns, advance)
    if not path.is_dir():
        return sequences.of_recording(path, arguments.sensor, arguments.frames, advance)
    if arguments.camera is None:
        raise OptionError(f"{source}: --camera has to say which camera took the images of a folder")
    depth = camera_file.load(arguments.camera).depth
    images = DepthImages(
        by_number(path, arguments.depth, 30.0, alone=True), depth.camera(), depth.depth_scale or DEPTH_SCALE,
        Geometry(depth.geometry), depth.invalid, float_scale=depth.depth_scale or 1.0,
    )  # fmt: skip
    folder = ImageFolder({"depth": images})
    return sequences.of_frames(path.name, folder.frames(), folder.cameras, "depth", arguments.frames, advance)


def _region(arguments: argparse.Namespace, shape: Sequence[int]) -> NDArray[np.bool_]:
    """Pixels that may show the target."""
    height, width = shape
    region = np.ones((height, width), np.bool_)
    if arguments.box is not None:
        left, top, right, bottom = arguments.box
        region[:] = False
        region[top : bottom + 1, left : right + 1] = True
    if arguments.mask is not None:
        mask = load_mask(arguments.mask, "--mask")
        if mask.shape != (height, width):
            raise OptionError(f"--mask {arguments.mask}: must be an image of {width} × {height} pixels")
        region &= mask
    if not region.any():
        raise OptionError(f"--box, --mask: they leave nothing of the image of {width} × {height} pixels")
    return region


def _write_model(found: measurement.NoiseCalibration, sensor: str, out: Path, level: Level) -> list[Path]:
    """Writes the table for the rig file, which says what it is worth, and its maps."""
    toml, written, model = out.with_suffix(".toml"), [], found.model
    comment = f"written by abs-service calibrate noise; {level}: see {out.with_suffix('.html').name}"
    try:
        if isinstance(model, PerPixel):
            maps = out.with_suffix(".npz")
            model.save(maps)
            written.append(maps)
            table = {"type": "per_pixel", "file": maps.name, "model": plugins.table(model.model)}
        else:
            table = plugins.table(model)
        text = toml_text.table(("sensors", sensor, "noise"), table, comment)
        if found.missing.targets:
            text += "\n" + toml_text.table(("sensors", sensor, "no_return"), plugins.plain(found.missing.law))
        atomic.write(toml, text)
    except OSError as error:
        raise OptionError(f"--out {out}: cannot be written: {error.strerror}") from error
    return [toml, *written]


def _out(given: Path | None, sensor: str, index: int) -> Path:
    """Output path without suffix, numbered from the second exposure setting on."""
    out = given or Path(f"noise-{sensor}")
    # The suffix is appended and never replaced: noise-1.2 is a name.
    name = f"{out.name}-{index + 1}" if index else out.name
    return out.with_name(f"{name}.x")


def _say(made: Report, setting: str, written: Sequence[Path], as_json: bool) -> None:
    if as_json:
        print(json.dumps(to_json(made), ensure_ascii=False))
    else:
        print(f"exposure {setting}:" if setting else made.title)
        for verdict in made.verdicts:
            about = f"{verdict.about}: " if verdict.about else ""
            print(f"  {verdict.level!s:8} {about}{verdict.text} {verdict.advice}".rstrip())
    print(f"wrote {', '.join(map(str, written))}", file=sys.stderr if as_json else sys.stdout)
