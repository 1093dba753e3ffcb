"""Makes `recordings/sample_oak`: a depthai recording of an OAK with a time-of-flight and a colour camera.

    .venv/bin/python -m tests.sample.oak

The images are the simulator's, of some of the moments in `recordings/sample.mcap`; the files and the calibration are
written by depthai itself, from the driver's own messages and in its units: millimetres along z, centimetres between the
cameras. Free to share (CC0).
"""

import json
import time
from collections.abc import Iterable
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from calib.camera import Camera
from drivers.contract.frame import Frame, Kind
from drivers.oak import library
from drivers.simulated.address import parse
from drivers.simulated.simulation import Simulation
from tests.sample.sample import DEVICE, EXPOSURES

SAMPLE = Path(__file__).parents[2] / "recordings" / "sample_oak"
#: Name of the file and socket of the camera, by the simulator's stream.
STREAMS = {
    ("tof", "depth"): ("tof_depth", 0),
    ("tof", "amplitude"): ("tof_amplitude", 0),
    ("color", "color"): ("color", 2),
}


def write(folder: Path, simulation: Simulation, exposures: Iterable[int]) -> None:
    """Writes files and calibration of a simulation's exposures."""
    folder.mkdir(exist_ok=True)
    heads = {name: head.camera for name, head in simulation.heads.items()}
    frames = [frame for k in exposures for frame in simulation.frames(k) if frame.key in STREAMS]
    for key, (name, socket) in STREAMS.items():
        images = [message(frame, heads[frame.sensor], socket) for frame in frames if frame.key == key]
        record(folder / f"{name}.mcap", images)
    content = calibration({0: heads["tof"], 2: heads["color"]}).eepromToJson()
    (folder / "calibration.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def record(path: Path, messages: list[Any]) -> None:
    """Writes messages to a file by depthai's `RecordMetadataOnly` node."""
    dai = library.load()
    path.unlink(missing_ok=True)
    with dai.Pipeline(False) as pipeline:
        node = pipeline.create(dai.node.RecordMetadataOnly)
        node.setRecordFile(path)
        node.setCompressionLevel(dai.RecordConfig.CompressionLevel.SLOWEST)
        queue = node.input.createInputQueue(maxSize=len(messages), blocking=True)
        pipeline.start()
        for item in messages:
            queue.send(item)
        time.sleep(0.5)  # depthai does not tell when the last one is written
        pipeline.stop()


def message(frame: Frame, camera: Camera, socket: int) -> Any:
    """A frame of the simulator as a `dai.ImgFrame`; its exposure ends at the simulator's time."""
    dai = library.load()
    image, pixel_format = pixels(frame, camera)
    made = dai.ImgFrame()
    height, width = image.shape[:2]
    made.setType(getattr(dai.ImgFrame.Type, pixel_format)).setSize(width, height).setStride(image.strides[0])
    made.setFrame(image)
    made.setInstanceNum(socket).setSequenceNum(frame.seq)
    microseconds = frame.t_host_ns // 1000
    made.setTimestamp(timedelta(seconds=1000, microseconds=microseconds))
    made.setTimestampDevice(timedelta(seconds=7, microseconds=microseconds))
    settings = dai.ImgFrame.CameraSettings()
    settings.exposureTimeUs, settings.sensitivityIso = 2000, 100
    made.cam = settings
    matrix = [[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]]
    transformation = dai.ImgTransformation(width, height, matrix)
    transformation.setDistortionCoefficients(camera.lens.coefficients.tolist())
    made.setTransformation(transformation)
    return made


def pixels(frame: Frame, camera: Camera) -> tuple[np.ndarray, str]:
    """The image in an OAK's format, and the name of the format: depth in millimetres along z."""
    if frame.kind == Kind.DEPTH:
        z = frame.si() * camera.rays()[..., 2]
        return np.nan_to_num(1000 * z).round().astype(np.uint16), "RAW16"
    if frame.kind == Kind.COLOR:
        return np.ascontiguousarray(frame.data), "RGB888i"
    return np.clip(frame.si(), 0, 65535).round().astype(np.uint16), "RAW16"


def calibration(cameras: dict[int, Camera]) -> Any:
    """The factory calibration that a device with these cameras would hold, each camera's pose relative to the first."""
    dai = library.load()
    handler = dai.CalibrationHandler()
    handler.setBoardInfo("simulated", "R0")
    sockets = {number: dai.CameraBoardSocket(number) for number in cameras}
    first, *others = cameras
    for number, camera in cameras.items():
        matrix = [[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]]
        handler.setCameraIntrinsics(sockets[number], matrix, camera.width, camera.height)
        handler.setDistortionCoefficients(sockets[number], [*camera.lens.coefficients.tolist(), *[0.0] * 6])
    for number in others:
        T = np.linalg.inv(cameras[first].T_rs) @ cameras[number].T_rs
        translation = (100 * T[:3, 3]).tolist()
        handler.setCameraExtrinsics(sockets[number], sockets[first], T[:3, :3].tolist(), translation, translation)
    return handler


if __name__ == "__main__":
    write(SAMPLE, parse(DEVICE).build(), EXPOSURES[:6])
    print(f"{SAMPLE.name}: {sum(file.stat().st_size for file in SAMPLE.iterdir()) / 1e3:.0f} kB")
