"""Turns images or a recording of another program into a recording that `abs-service replay` tracks.

  abs-service import data/cloth --layout pairs --camera cloth.toml --out cloth.mcap
  abs-service import data/cloth --layout pairs --camera cloth.toml --depth 'd*.png' --color 'c*.jpg' --out cloth.mcap
  abs-service import data/cloth --layout pairs --camera cloth.toml --frames 200:319 --out cloth.mcap
  abs-service import rgbd_dataset_freiburg1_xyz --layout tum --out xyz.mcap
  abs-service import dataset/realsense --layout open3d --out scan.mcap
  abs-service import kinect.mkv --layout azure --out kinect.mcap
  abs-service import scene0000_00.sens --layout sens --frames 0:299 --out scene.mcap

Recordings of other programs bring their own calibration: `azure` (Azure Kinect, MKV), `o3r` (ifm O3R, buffers of its
process interface), `oak` (depthai, MCAP), `realsense` (librealsense, ROS 1 bag), `ros2` (ROS 2 bag of any camera) and
`sens` (BundleFusion and ScanNet). See docs/how-to/import.md.

Folders hold images. Layout `pairs`: images of one exposure share the last number in their names. They carry no time, so
the recording begins in 1970. Layout `tum`: the lists depth.txt and rgb.txt of the TUM RGB-D benchmark name the images
and their times. Layout `open3d`: what Open3D's recorders write, with color/, depth/ and camera_intrinsic.json or
intrinsic.json; like `pairs`, without times. --frames 200:319 takes a part, both ends included; 200:319:5 every fifth;
7,9,20: has several ranges. Numbers are those in the names (`pairs`, `open3d`) or count from 0 the lines of depth.txt
(`tum`) or the frames of the file (`sens`).

Many files of layout `sens` have no time stamps: a note says so, and that 30 frames per second are assumed; --rate
gives another rate.

Depth images have one channel of 16 bits, in millimetres (`pairs`; `open3d` if its file does not tell) or 1/5000 m
(`tum`), colour images have 8 bits. The camera file says what took them; without a table `color` in it there are no
colour images:

  [depth]
  width = 320
  height = 240
  fx = 275.0
  fy = 275.0
  cx = 160.0
  cy = 120.0
  depth_scale = 0.001     # metres per unit; optional, as are the following
  geometry = "z"          # or "radial": from the camera centre
  invalid = 0             # means "no return"
  lens = []               # k1 k2 p1 p2 k3 k4 k5 k6, in OpenCV's order; k1 k2 k3 k4 if lens_model = "fisheye"
  T_rs = { rotation_vector = [0.0, 0.0, 0.0], translation = [0.0, 0.0, 0.0] }   # sensor to rig

  [color]                 # the same keys but depth_scale, geometry and invalid
"""

import argparse
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from abs_service.commands.images import camera_file, frame_numbers, import_file, open3d_folder
from abs_service.commands.images.camera_file import CameraFile
from abs_service.commands.parts.options import OptionError, check_new, number
from abs_service.supervision.exit_codes import Exit
from calib.files import limited, nested
from drivers.contract.frame import Geometry
from drivers.contract.text import printable
from drivers.encoding.foreign_recording import ForeignRecording
from drivers.image_folder.images import ColorImages, DepthImages, ImageFolder, Images
from drivers.image_folder.listing import ImageFile, ImageFolderError, by_list, by_number, time_problem
from drivers.opening import open_recording
from drivers.sens.recording import SensRecording

#: Metres per unit of depth images whose camera file does not state it.
DEPTH_SCALES = {"open3d": 0.001, "pairs": 0.001, "tum": 1 / 5000}
#: Depth and colour images of the layouts whose images are numbered.
PATTERNS = {"open3d": ("depth/*.png", "color/*"), "pairs": ("depth_*.png", "color_*.[jp]*g")}
#: Layouts that are one file and contain their cameras.
RECORDINGS = ("azure", "o3r", "oak", "realsense", "ros2", "sens")
#: Options of a layout; those that are not here have none.
OPTIONS = {
    "open3d": ("camera", "depth", "color", "rate", "frames"),
    "pairs": ("camera", "depth", "color", "mask", "rate", "frames"),
    "sens": ("rate", "frames"),
    "tum": ("camera", "frames"),
}
#: Default rate of numbered images [Hz].
RATE_HZ = 30.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service import`."""
    parser.add_argument("path", type=Path, metavar="PATH", help="folder with the images, or file")
    parser.add_argument("--layout", choices=sorted([*DEPTH_SCALES, *RECORDINGS]), required=True, help="what it is")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE.mcap", help="recording to write; must not exist"
    )
    parser.add_argument(
        "--camera", type=Path, metavar="FILE", help="camera file, TOML or JSON (pairs; tum, open3d: optional)"
    )
    parser.add_argument("--depth", metavar="GLOB", help="depth images (pairs: depth_*.png, open3d: depth/*.png)")
    parser.add_argument("--color", metavar="GLOB", help="colour images (pairs: color_*, PNG or JPEG; open3d: color/*)")
    parser.add_argument("--mask", metavar="GLOB", help="images, black or transparent where depth is left out (pairs)")
    parser.add_argument(
        "--rate",
        type=number(0.001, 10_000, "a number from 0.001 to 10000"),
        metavar="HZ",
        help=f"exposures per second (pairs, open3d: {RATE_HZ:g}; sens: default is the file's time stamps)",
    )
    parser.add_argument(
        "--frames",
        type=frame_numbers.parse,
        default=frame_numbers.ALL,
        metavar="FIRST:LAST[:STEP]",
        help="numbers of the exposures to import (pairs, open3d, sens, tum; default: all)",
    )
    parser.add_argument("--rig", type=Path, metavar="FILE", help="configuration to attach, for a replay without one")


def run(arguments: argparse.Namespace) -> int:
    """Imports; errors of the images or options are raised as errors of this package or of `drivers`."""
    _check_options(arguments)
    rig_toml = _rig(arguments.rig)
    foreign_recording = _foreign_recording(arguments)
    check_new(arguments.out, "--out")
    partial = arguments.out.with_name(f"{arguments.out.name}.partial")
    try:
        counts = import_file.write(partial, arguments.path.resolve().stem, foreign_recording, rig_toml)
        partial.rename(arguments.out)
    except OSError as error:
        raise OptionError(f"--out {arguments.out}: cannot be written: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)
    names = (
        (stream if sensor == stream else f"{sensor}/{stream}", number) for (sensor, stream), number in counts.items()
    )
    print(f"{arguments.out}: {', '.join(f'{number} {name}' for name, number in names)} images; next:")
    shown = printable(shlex.quote(str(arguments.out)))
    print(f"  abs-service {f'replay {shown}' if rig_toml else f'new rig.toml --recording {shown}'}")
    return Exit.OK


def _check_options(arguments: argparse.Namespace) -> None:
    own = OPTIONS.get(arguments.layout, ())
    for option in OPTIONS["pairs"]:
        if option not in own and getattr(arguments, option) not in (None, frame_numbers.ALL):
            allowed = ", ".join(f"--{name}" for name in own) or "no options but --out and --rig"
            raise OptionError(f"--{option}: layout {arguments.layout} takes {allowed}")


def _foreign_recording(arguments: argparse.Namespace) -> ForeignRecording:
    if arguments.layout not in RECORDINGS:
        return ImageFolder(_streams(arguments, _cameras(arguments)))
    if arguments.layout == "sens":
        return _sens(arguments)
    return open_recording(arguments.layout, arguments.path)


def _sens(arguments: argparse.Namespace) -> ForeignRecording:
    """Frames that are numbered, as images are, but may have times of their own."""
    recording = SensRecording(arguments.path, arguments.frames.__contains__, arguments.rate)
    if recording.time_problem:
        what = f"{arguments.path}: {recording.time_problem}; --rate gives another rate"
        print(f"abs-service: note: {what}", file=sys.stderr)
    return recording


def _cameras(arguments: argparse.Namespace) -> CameraFile:
    if arguments.camera is not None:
        return camera_file.load(arguments.camera)
    if arguments.layout == "tum":
        return camera_file.TUM
    if arguments.layout == "open3d":
        return open3d_folder.load(arguments.path)
    raise OptionError("--camera: layout pairs needs a camera file; `abs-service import --help` shows one")


def _rig(path: Path | None) -> bytes:
    """The text of the configuration to attach, empty if there is none."""
    if path is None:
        return b""
    try:
        text = limited.text(path)
        nested.toml(text)
    except OSError as error:
        raise OptionError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise OptionError(f"{path}: not TOML: {error}") from error
    return text.encode()


def _streams(arguments: argparse.Namespace, cameras: CameraFile) -> Mapping[str, Images]:
    """The images to import, by sensor name."""
    numbered = arguments.layout in PATTERNS
    folder, rate = arguments.path, arguments.rate or RATE_HZ
    if not folder.is_dir():
        raise ImageFolderError(f"{folder}: {'is no folder' if folder.exists() else 'no such folder'}")
    depth = cameras.depth
    depth_names, color_names = PATTERNS.get(arguments.layout, ("", ""))
    depth_names, color_names = arguments.depth or depth_names, arguments.color or color_names
    if not numbered and (problem := time_problem(folder, "depth.txt")):
        advice = "where the lines are in order and the times are wrong, --layout pairs takes the numbers in the names"
        print(f"abs-service: note: {folder / 'depth.txt'}: {problem}; {advice}", file=sys.stderr)
    files = arguments.frames.of(by_number(folder, depth_names, rate) if numbered else by_list(folder, "depth.txt"))
    streams: dict[str, Images] = {
        "depth": DepthImages(
            files=files,
            camera=depth.camera(),
            scale=depth.depth_scale or DEPTH_SCALES[arguments.layout],
            geometry=Geometry(depth.geometry),
            invalid=depth.invalid,
            masks=_masks(files, folder, arguments.mask, rate),
        )
    }
    if cameras.color is None:
        if arguments.color is not None:
            raise OptionError(f"--color: {arguments.camera} has no table color that describes the colour camera")
    else:
        colors = by_number(folder, color_names, rate) if numbered else by_list(folder, "rgb.txt")
        if numbered:
            colors = arguments.frames.of(colors)
        elif arguments.frames is not frame_numbers.ALL:
            colors = frame_numbers.nearest(colors, files)
        streams["color"] = ColorImages(colors, cameras.color.camera())
    return streams


def _masks(depth: Sequence[ImageFile], folder: Path, pattern: str | None, rate_hz: float) -> Mapping[int, Path]:
    """The mask of every depth image by sequence number; none at all without a pattern."""
    if pattern is None:
        return {}
    masks = {mask.seq: mask.path for mask in by_number(folder, pattern, rate_hz)}
    for file in depth:
        if file.seq not in masks:
            raise ImageFolderError(f"{file.path}: no mask that matches {pattern!r} has the number {file.seq}")
    return masks
