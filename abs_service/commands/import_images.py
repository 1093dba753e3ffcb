"""Turns a folder of image files into a recording that `abs-service replay` tracks.

  abs-service import data/cloth --layout pairs --camera cloth.toml --out cloth.mcap
  abs-service import data/cloth --layout pairs --camera cloth.toml --depth 'd*.png' --color 'c*.jpg' --out cloth.mcap
  abs-service import rgbd_dataset_freiburg1_xyz --layout tum --out xyz.mcap

Layout `pairs`: images of one exposure share the last number in their names. They carry no time, so the recording begins
in 1970. Layout `tum`: the lists depth.txt and rgb.txt of the TUM RGB-D benchmark name the images and their times.

Depth images have one channel of 16 bits, in millimetres (`pairs`) or 1/5000 m (`tum`), colour images have 8 bits. The
camera file says what took them; without a table `color` in it there are no colour images:

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
  lens = []               # k1 k2 p1 p2 k3 k4 k5 k6, in OpenCV's order
  T_rs = { rotation_vector = [0.0, 0.0, 0.0], translation = [0.0, 0.0, 0.0] }   # sensor to rig

  [color]                 # the same keys but depth_scale, geometry and invalid
"""

import argparse
import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from abs.v1.common_pb2 import Header
from rich.console import Console
from rich.progress import track

from abs_service import announcements, keys
from abs_service.commands import camera_file
from abs_service.commands.camera_file import CameraFile
from abs_service.exits import Exit
from calib.camera import Camera
from drivers import codec
from drivers.frame import Frame, Geometry
from drivers.image_folder.images import ColorImages, DepthImages, Images, in_order
from drivers.image_folder.listing import ImageFile, ImageFolderError, by_list, by_number
from drivers.mcap_file import McapFile

#: Metres per unit of depth images whose camera file does not tell.
DEPTH_SCALES = {"pairs": 0.001, "tum": 1 / 5000}


class ImportOptionError(Exception):
    """Options that do not go together, or a file that they name and that cannot be used."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service import`."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder with the images")
    parser.add_argument("--layout", choices=sorted(DEPTH_SCALES), required=True, help="how the images are named")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE.mcap", help="recording to write; must not exist"
    )
    parser.add_argument("--camera", type=Path, metavar="FILE", help="camera file, TOML or JSON; optional for tum")
    parser.add_argument("--depth", default="depth_*.png", metavar="GLOB", help="depth images (pairs; %(default)s)")
    parser.add_argument("--color", default="color_*.png", metavar="GLOB", help="colour images (pairs; %(default)s)")
    parser.add_argument("--mask", metavar="GLOB", help="images, black or transparent where depth is left out (pairs)")
    parser.add_argument(
        "--rate", type=_rate, default=30.0, metavar="HZ", help="exposures per second (pairs; %(default)g)"
    )
    parser.add_argument("--rig", type=Path, metavar="FILE", help="configuration to attach, for a replay without one")


def run(arguments: argparse.Namespace) -> int:
    """Imports; what is wrong with the images or options is raised as an error of this package or of `drivers`."""
    cameras = _cameras(arguments)
    rig_toml = _rig(arguments.rig)
    streams = _streams(arguments, cameras)
    if arguments.out.exists():
        raise ImportOptionError(f"{arguments.out}: exists already; remove it or choose another name")
    partial = arguments.out.with_name(f"{arguments.out.name}.partial")
    try:
        _write(partial, arguments.folder.resolve().name, streams, rig_toml)
        partial.rename(arguments.out)
    except OSError as error:
        raise ImportOptionError(f"{arguments.out}: cannot be written: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)
    counts = ", ".join(f"{len(images.files)} {name}" for name, images in streams.items())
    print(f"{arguments.out}: {counts} images")
    return Exit.OK


def _cameras(arguments: argparse.Namespace) -> CameraFile:
    if arguments.camera is not None:
        return camera_file.load(arguments.camera)
    if arguments.layout == "tum":
        return camera_file.TUM
    raise ImportOptionError("--camera: layout pairs needs a camera file; `abs-service import --help` shows one")


def _rig(path: Path | None) -> bytes:
    """The text of the configuration to attach, empty if there is none."""
    if path is None:
        return b""
    try:
        text = path.read_bytes()
        tomllib.loads(text.decode())
    except OSError as error:
        raise ImportOptionError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ImportOptionError(f"{path}: not TOML: {error}") from error
    return text


def _streams(arguments: argparse.Namespace, cameras: CameraFile) -> Mapping[str, Images]:
    """The images to import, by sensor name."""
    numbered = arguments.layout == "pairs"
    if arguments.mask is not None and not numbered:
        raise ImportOptionError("--mask: only layout pairs has masks")
    folder, rate = arguments.folder, arguments.rate
    if not folder.is_dir():
        raise ImageFolderError(f"{folder}: no such folder")
    depth = cameras.depth
    files = by_number(folder, arguments.depth, rate) if numbered else by_list(folder, "depth.txt")
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
    if cameras.color is not None:
        files = by_number(folder, arguments.color, rate) if numbered else by_list(folder, "rgb.txt")
        streams["color"] = ColorImages(files, cameras.color.camera())
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


def _write(path: Path, rig: str, streams: Mapping[str, Images], rig_toml: bytes) -> None:
    cameras = {sensor: images.camera for sensor, images in streams.items()}
    start_ns = min(images.files[0].t_ns for images in streams.values())
    total = sum(len(images.files) for images in streams.values())
    with path.open("wb") as stream:
        file = McapFile(stream)
        if rig_toml:
            file.attach("rig.toml", "text/toml", rig_toml, start_ns)
        _write_cameras(file, rig, cameras, start_ns)
        frames = in_order(list(streams.values()))
        for frame in track(frames, "importing", total, console=Console(stderr=True), transient=True):
            _write_frame(file, rig, frame)
        file.finish()


def _write_cameras(file: McapFile, rig: str, cameras: Mapping[str, Camera], wall_ns: int) -> None:
    for sensor, camera in cameras.items():
        model = announcements.sensor_model(_header(rig, wall_ns, 0), sensor, camera, {})
        calibration = announcements.calibration(sensor, camera, wall_ns)
        for topic, message in ((keys.model(sensor), model), (keys.calibration(sensor), calibration)):
            file.write(f"/{topic}", message.DESCRIPTOR.full_name, message.SerializeToString(), wall_ns, 0)
    transforms = announcements.transforms(cameras, wall_ns)
    file.write(f"/{keys.TRANSFORMS}", transforms.DESCRIPTOR.full_name, transforms.SerializeToString(), wall_ns, 0)


def _write_frame(file: McapFile, rig: str, frame: Frame) -> None:
    topic, wall_ns = keys.image(frame.sensor, frame.stream), frame.t_host_ns
    info = codec.encode_info(frame, _header(rig, wall_ns, frame.seq))
    file.write(f"/{topic}", codec.IMAGE_SCHEMA, codec.encode_image(frame, wall_ns), wall_ns, frame.seq)
    file.write(f"/{keys.info(topic)}", codec.INFO_SCHEMA, info, wall_ns, frame.seq)


def _header(rig: str, wall_ns: int, seq: int) -> Header:
    header = Header(t_host_ns=wall_ns, seq=seq, rig=rig, boot_id="import")
    header.stamp.FromNanoseconds(wall_ns)
    return header


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not 0.001 <= rate <= 10_000:
        raise argparse.ArgumentTypeError(f"{text!r} must be a number from 0.001 to 10000")
    return rate
