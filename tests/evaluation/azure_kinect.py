"""One real frame of an Azure Kinect: depth, amplitude and colour, with the factory's calibration of both cameras."""

import json
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

from calib import pose
from calib.camera import Camera
from calib.lens import Lens
from calib.warp.mesh import MeshWarp
from calib.warp.pictures import PictureLookup
from tests.evaluation import warping

#: The depth camera's mode: what part of the 1024 × 1024 pixels that are calibrated its images show.
CROP = (192, 180, 640, 576)


@dataclass(frozen=True)
class Shot:
    """Both cameras, radial distances [m], amplitudes and colours of one moment."""

    depth: Camera
    color: Camera
    distance: np.ndarray
    amplitude: np.ndarray
    rgb: np.ndarray


def read(folder: Path) -> Shot:
    """The frame in a folder with `recording.mkv` and the calibration beside it.

    Raises:
        ImportError: PyAV, which reads the container, is not installed.
    """
    import av  # not needed by anything else here

    content = json.loads((folder / "calibration_tests_asset.json").read_text(encoding="utf-8"))
    by_place = {camera["Location"]: camera for camera in content["CalibrationInformation"]["Cameras"]}
    depth = _camera(by_place["CALIBRATION_CameraLocationD0"], 1024, 1024, CROP)
    color = _camera(by_place["CALIBRATION_CameraLocationPV0"], 1280, 960, (0, 120, 1280, 720))
    frames: dict[str, np.ndarray] = {}
    with av.open(str(folder / "recording.mkv")) as container:
        for packet in container.demux(container.streams.video):
            for frame in packet.decode():
                title = packet.stream.metadata["title"]
                layout = "rgb24" if title == "COLOR" else "gray16le"
                frames.setdefault(title, _pixels(frame, layout))
    z = np.where(frames["DEPTH"] > 0, frames["DEPTH"] * 1e-3, np.nan)
    return Shot(depth, color, z * depth.lookup.ray_length, frames["IR"].astype(np.float32), frames["COLOR"])


def _pixels(frame: Any, layout: str) -> np.ndarray:
    return frame.to_ndarray(format=layout)


def _camera(content: Mapping[str, Any], width: int, height: int, crop: tuple[int, int, int, int]) -> Camera:
    """Parameters are relative to the image that was calibrated, whose corner is (0, 0), of a size in pixels of ours."""
    cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, _, _, p2, p1 = content["Intrinsics"]["ModelParameters"]
    left, top, columns, rows = crop
    turn, shift = (
        cv2.Rodrigues(np.reshape(content["Rt"]["Rotation"], (3, 3)).astype(float))[0],
        content["Rt"]["Translation"],
    )
    T_sr = pose.from_rotation_vector(np.ravel(turn), shift)  # the rotation is one to seven digits only
    lens = Lens(np.array([k1, k2, p1, p2, k3, k4, k5, k6]))
    center = (cx * width - left - 0.5, cy * height - top - 0.5)
    return Camera(columns, rows, fx * width, fy * height, *center, lens, pose.inverse(T_sr))


def table(folder: Path, pool: ThreadPoolExecutor) -> str:
    """How much of what the mesh fills each method fills, how it differs from the mesh, and how long it takes."""
    shot = read(folder)
    found = {name: method(shot.distance) for name, method in warping.methods(shot.depth, shot.color, pool).items()}
    ours = found["mesh"]
    lines = ["", "| method | of the mesh's pixels % | median difference mm | p95 mm |", "|---|---|---|---|"]
    for name, distance in found.items():
        both = np.isfinite(distance) & np.isfinite(ours)
        off = 1e3 * (distance - ours)[both]
        share = 100 * np.count_nonzero(both) / np.count_nonzero(np.isfinite(ours))
        lines.append(f"| {name} | {share:.1f} | {np.median(off):+.2f} | {np.quantile(np.abs(off), 0.95):.2f} |")
    return "\n".join(lines)


def draw(folder: Path, path: Path) -> None:
    """Depth and its deviation in the colour camera's view, and colour in the depth camera's, beside the originals."""
    shot = read(folder)
    warped = MeshWarp(shot.depth, shot.color).warp(shot.distance)
    colors = PictureLookup(shot.depth, shot.color).look(shot.distance).blended(shot.rgb)
    deviation = warped.deviation(np.full(shot.distance.shape, 2e-3))
    figure = Figure(figsize=(13, 7.4), layout="constrained")
    axes = figure.subplots(2, 3)
    near, far = np.nanquantile(shot.distance, [0.02, 0.98])
    shown = [
        ("depth as measured [m]", shot.distance, {"vmin": near, "vmax": far, "cmap": "viridis"}),
        ("depth in the colour camera's view [m]", warped.distance, {"vmin": near, "vmax": far, "cmap": "viridis"}),
        ("its deviation [mm], if 2 mm were measured", 1e3 * deviation, {"vmin": 0, "vmax": 6, "cmap": "magma"}),
        ("colour as seen", shot.rgb, {}),
        ("colour in the depth camera's view", np.nan_to_num(colors, nan=255).astype(np.uint8), {}),
        ("hidden from the depth camera", warped.hidden(), {"cmap": "gray_r"}),
    ]
    for place, (title, pixels, style) in zip(axes.ravel(), shown):
        drawn = place.imshow(pixels, interpolation="nearest", **style)
        place.set_title(title, fontsize=10)
        place.set_axis_off()
        if "vmin" in style:
            figure.colorbar(drawn, ax=place, shrink=0.7)
    figure.savefig(path, dpi=62)
