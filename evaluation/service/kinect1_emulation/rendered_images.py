"""Image sequences for emulated cameras, rendered by `drivers.simulated` in a Kinect's raw values."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.pose import Pose
from drivers.kinect1.reference_plane import NO_RETURN, ReferencePlane
from drivers.simulated.scene.scene import Scene
from drivers.simulated.sensors.bayer import Bayer
from drivers.simulated.sensors.color import Picture
from drivers.simulated.sensors.exposure import Exposure
from drivers.simulated.sensors.structured_light import StructuredLight, StructuredLightNoise
from evaluation.service.kinect1_emulation.bit_packing import pack

PLANE = ReferencePlane()


def render(path: Path, scene: Scene, T_rs: Pose, seconds: float, rate_hz: float) -> None:
    """Renders the images of a Kinect for a scene, from its start, to a file.

    Args:
        path: of the file.
        scene: the scene.
        T_rs: pose of its depth camera in the rig.
        seconds: length of the sequence [s].
        rate_hz: images per second.
    """
    # The raw values quantise the disparity, so the simulated head must not.
    noise = StructuredLightNoise(step=1e-6)
    depth_camera, color_camera = replace(PLANE.depth_camera(), T_rs=T_rs), PLANE.color_camera()
    depth = StructuredLight("depth", depth_camera, scene, rate_hz, noise)
    color = Bayer("color", Picture(replace(color_camera, T_rs=T_rs @ color_camera.T_rs), scene), rate_hz)
    generator = np.random.default_rng(1)
    images: dict[str, list[NDArray[np.uint8]]] = {"depth": [], "color": []}
    for number in range(round(seconds * rate_hz)):
        exposure = Exposure(number, scene.at(number / rate_hz), generator, 0)
        (frame,), (mosaic,) = depth.expose(exposure), color.expose(exposure)
        images["depth"].append(np.frombuffer(pack(raw(frame.si()), 11), np.uint8))
        images["color"].append(np.frombuffer(mosaic.data.tobytes(), np.uint8))
    np.savez(path, allow_pickle=False, **{name: np.stack(shown) for name, shown in images.items()})


def raw(z: NDArray[np.floating]) -> NDArray[np.int64]:
    """Raw value of each distance along the optical axis [m]; NaN is no return."""
    infinity = 4 * (PLANE.baseline / PLANE.pixel + 0.375) + 4 * PLANE.shift
    values = np.rint(infinity - 1 / (np.where(np.isnan(z), 1.0, z) * PLANE.step))
    return np.where(np.isnan(z), NO_RETURN, np.clip(values, 0, NO_RETURN)).astype(np.int64)
