"""The images of a folder that `abs-service import` reads: which files, of which times, taken by which cameras."""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from abs_service.commands.images import foreign_cameras, frame_numbers, open3d_folder, partners
from abs_service.commands.parts import camera_file
from abs_service.commands.parts.camera_file import CameraFile
from abs_service.commands.parts.options import OptionError
from calib.formats import plausibility
from drivers.contract.frame import Geometry
from drivers.image_folder import image_file
from drivers.image_folder.images import ColorImages, DepthImages, ImageFolder, Images
from drivers.image_folder.listing import ImageFile, ImageFolderError, are_timed, by_list, by_name, time_problem

#: Metres per unit of depth images of 16 bits whose camera file does not state it, by layout.
LAYOUTS = {"open3d": 0.001, "pairs": 0.001, "tum": 1 / 5000}
#: Metres per unit of depth images of floating-point numbers, likewise.
_FLOAT_SCALE = 1.0
#: What some programs write where there is no return, and the share of pixels from which that is asked.
_MAXIMUM, _MANY = 65535, 0.001
#: Depth and colour images of the layouts that find them by their names.
_PATTERNS = {"open3d": ("depth/*.png", "color/*"), "pairs": ("depth_*.png", "color_*.[jp]*g")}
#: Lists of depth and colour images of the others.
_LISTS = ("depth.txt", "rgb.txt")
#: Default rate of numbered images [Hz].
RATE_HZ = 30.0


def read(arguments: argparse.Namespace) -> ImageFolder:
    """The images that are asked for; what is doubtful about their times is said on standard error.

    Raises:
        CameraFileError, ImageFolderError, OptionError: what is asked for is not there, or contradicts itself.
    """
    folder: Path = arguments.path
    if not folder.is_dir():
        what = f"is no folder, as layout {arguments.layout} has it" if folder.exists() else "no such folder"
        raise ImageFolderError(f"{folder}: {what}")
    depth_source, color_source = _PATTERNS.get(arguments.layout, _LISTS)
    depth_source, color_source = arguments.depth or depth_source, arguments.color or color_source
    has_color = bool(arguments.color) or any(folder.glob(color_source))
    if arguments.layout == "pairs" and arguments.camera is None:
        raise OptionError("--camera: layout pairs needs a camera file; `abs-service import --help` shows one")
    all_depth = _listed(arguments, depth_source)
    cameras = _cameras(arguments, all_depth[0], has_color)
    depth = arguments.frames.of(all_depth)
    scale = arguments.depth_scale or cameras.depth.depth_scale
    images = DepthImages(
        files=depth,
        camera=cameras.depth.camera(),
        scale=scale or LAYOUTS[arguments.layout],
        geometry=Geometry(cameras.depth.geometry),
        invalid=cameras.depth.invalid,
        masks=_masks(depth, arguments),
        float_scale=scale or _FLOAT_SCALE,
    )
    streams: dict[str, Images] = {"depth": images}
    if cameras.color is not None:
        color = _colors(arguments, color_source, depth)
        streams["color"] = ColorImages(color, cameras.color.camera())
    elif arguments.color is not None:
        raise OptionError(f"--color: {arguments.camera} has no table color that describes the colour camera")
    print(_distance(images))
    return ImageFolder(streams)


def _listed(arguments: argparse.Namespace, source: str) -> list[ImageFile]:
    """All images that a pattern or list names."""
    if arguments.layout not in _PATTERNS:
        if problem := time_problem(arguments.path, source):
            advice = (
                "where the lines are in order and the times are wrong, --layout pairs takes the numbers in the names"
            )
            _note(f"{arguments.path / source}: {problem}; {advice}")
        return by_list(arguments.path, source)
    files = by_name(arguments.path, source, arguments.rate or RATE_HZ)
    if arguments.rate is not None and are_timed(files):
        raise OptionError(f"--rate: the names of images have times, such as {files[0].path.name}")
    return files


def _colors(arguments: argparse.Namespace, source: str, depth: Sequence[ImageFile]) -> list[ImageFile]:
    """The colour images of the depth images."""
    color = _listed(arguments, source)
    is_timed = arguments.layout not in _PATTERNS or are_timed(depth)
    if is_timed and arguments.layout in _PATTERNS and not are_timed(color):
        raise ImageFolderError(
            f"{color[0].path}: its name has no time, as that of {depth[0].path.name}; lists of times and paths, "
            f"{' and '.join(_LISTS)}, can say it (layout tum)"
        )
    if not is_timed:
        color = arguments.frames.of(color)
        partners.check_numbers(depth, color, _note)
        return color
    partners.check_times(depth, color, _note)
    return color if arguments.frames is frame_numbers.ALL else frame_numbers.nearest(color, depth)


def _cameras(arguments: argparse.Namespace, first: ImageFile, has_color: bool) -> CameraFile:
    if arguments.camera is not None:
        height, width = image_file.read(first.path).shape[:2]
        cameras, lost = foreign_cameras.load(arguments.camera, (width, height), has_color)
        tables = {"depth": cameras.depth, "color": cameras.color}
        described = {name: table.camera() for name, table in tables.items() if table is not None}
        doubts = plausibility.doubts(described)
        for pair, how in plausibility.baselines(described).items():
            if how.length > plausibility.MAX_BASELINE_M:
                doubts += (f"{pair} are {how.length:.4g} m apart: is the translation of T_rs in metres?",)
            elif how.length or how.angle:
                print(f"{pair}: {how}, color {how.side} depth as they see it")
        for one in (*(f"not taken: {what}" for what in lost), *doubts):
            _note(f"{arguments.camera}: {one}")
        return cameras
    if arguments.layout == "open3d":
        return open3d_folder.load(arguments.path)
    _note("without --camera, the cameras are those that the TUM benchmark recommends: fx = fy = 525, (319.5, 239.5)")
    return camera_file.TUM


def _masks(depth: Sequence[ImageFile], arguments: argparse.Namespace) -> Mapping[int, Path]:
    """The mask of every depth image by sequence number; none at all without a pattern."""
    if arguments.mask is None:
        return {}
    masks = {mask.t_ns: mask.path for mask in by_name(arguments.path, arguments.mask, arguments.rate or RATE_HZ)}
    for file in depth:
        if file.t_ns not in masks:
            what = "has its time" if are_timed(depth) else f"has the number {file.seq}"
            raise ImageFolderError(f"{file.path}: no mask that matches {arguments.mask!r} {what}")
    return {file.seq: masks[file.t_ns] for file in depth}


def _distance(images: DepthImages) -> str:
    """The median distance of the first depth image, from which people see that a scale is five times the true one."""
    first = images.frame(images.files[0])
    distances = first.si()
    distances = distances[np.isfinite(distances)]
    if (share := np.mean(first.data == _MAXIMUM)) > _MANY and first.invalid != _MAXIMUM:
        _note(
            f"{images.files[0].path}: {share:.0%} of its pixels have {_MAXIMUM}, the largest value; if that means no "
            f"return, write invalid = {_MAXIMUM} into the table depth of a camera file"
        )
    what = f"median distance {np.median(distances):.3g} m" if distances.size else "no distance in it"
    return f"{images.files[0].path}: {what}, at {first.scale:g} m a unit; --depth-scale sets another"


def _note(text: str) -> None:
    print(f"abs-service: note: {text}", file=sys.stderr)
