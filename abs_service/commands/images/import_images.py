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

Folders hold images. Layout `pairs`: images of one exposure share the last number in their names, and the recording
begins in 1970; or all names have times, such as 1305031102.160407.png, or Unix times in ms, µs or ns. Layout `tum`: the
lists depth.txt and rgb.txt of the TUM RGB-D benchmark name the images and their times. Layout `open3d`: what Open3D's
recorders write, with color/, depth/ and camera_intrinsic.json or intrinsic.json; like `pairs`. --frames 200:319 takes a
part, both ends included; 200:319:5 every fifth; 7,9,20: has several ranges. Numbers are those in the names (`pairs`,
`open3d`) or count from 0 the lines of depth.txt (`tum`), names with times, or the frames of the file (`sens`).

Many files of layout `sens` have no time stamps: a note says so, and that 30 frames per second are assumed; --rate
gives another rate.

Depth images have one channel of 16 bits, in millimetres (`pairs`; `open3d` if its file does not tell) or 1/5000 m
(`tum`), or of floating-point numbers in metres (TIFF, NumPy's .npy); colour images have 8 bits. --camera says what took
them: a calibration file, intrinsics of ROS, OpenCV or Open3D, a text with the matrix K, or a camera file. Without a
table `color` in it there are no colour images:

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
  T_rs = { rotation_vector = [0.0, 0.0, 0.0], translation = [0.0, 0.0, 0.0] }   # sensor to rig [rad, m]; or 4 rows

  [color]                 # the same keys but depth_scale, geometry and invalid
"""

import argparse
import shlex
import sys
from pathlib import Path

from abs_service.commands.images import folder_images, frame_numbers, import_file
from abs_service.commands.parts.options import OptionError, check_new, number
from abs_service.supervision.exit_codes import Exit
from calib.files import limited, nested
from drivers.contract.text import printable
from drivers.encoding.foreign_recording import ForeignRecording
from drivers.opening import open_recording
from drivers.sens.recording import SensRecording

#: Layouts that are one file and contain their cameras.
RECORDINGS = ("azure", "o3r", "oak", "realsense", "ros2", "sens")
#: Options of a layout; those that are not here have none.
OPTIONS = {
    "open3d": ("camera", "depth", "depth_scale", "color", "rate", "frames"),
    "pairs": ("camera", "depth", "depth_scale", "color", "mask", "rate", "frames"),
    "sens": ("rate", "frames"),
    "tum": ("camera", "depth_scale", "frames"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service import`."""
    parser.add_argument("path", type=Path, metavar="PATH", help="folder with the images, or file")
    parser.add_argument(
        "--layout", choices=sorted([*folder_images.LAYOUTS, *RECORDINGS]), required=True, help="what it is"
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE.mcap", help="recording to write; must not exist"
    )
    parser.add_argument(
        "--camera", type=Path, metavar="FILE", help="what took the images, see above (pairs; tum, open3d: optional)"
    )
    parser.add_argument("--depth", metavar="GLOB", help="depth images (pairs: depth_*.png, open3d: depth/*.png)")
    parser.add_argument(
        "--depth-scale",
        type=number(1e-9, 1e9, "a positive number of metres"),
        metavar="METRES",
        help="length of one unit of the depth images (pairs, open3d, tum; default: that of the camera file, see above)",
    )
    parser.add_argument("--color", metavar="GLOB", help="colour images (pairs: color_*, PNG or JPEG; open3d: color/*)")
    parser.add_argument("--mask", metavar="GLOB", help="images, black or transparent where depth is left out (pairs)")
    parser.add_argument(
        "--rate",
        type=number(0.001, 10_000, "a number from 0.001 to 10000"),
        metavar="HZ",
        help=f"exposures per second (pairs, open3d: {folder_images.RATE_HZ:g}; sens: default is the file's times)",
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
            allowed = ", ".join(map(_typed, own)) or "no options but --out and --rig"
            raise OptionError(f"{_typed(option)}: layout {arguments.layout} takes {allowed}")


def _typed(option: str) -> str:
    """An option as it is typed."""
    return f"--{option.replace('_', '-')}"


def _foreign_recording(arguments: argparse.Namespace) -> ForeignRecording:
    if arguments.layout not in RECORDINGS:
        return folder_images.read(arguments)
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
