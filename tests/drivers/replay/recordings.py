"""Small recordings of the simulated device, intact and corrupt."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path

from absmsg.v1.common_pb2 import Header

from abs_service.capture import sensor_metadata
from calib.camera import Camera
from drivers.contract.device import Truth
from drivers.contract.frame import Frame
from drivers.encoding import codec
from drivers.encoding.mcap_file import Compression, McapFile
from drivers.replay.contents import scan
from drivers.simulated.address import parse
from tests.abs_service.commands.recordings.simulated_recording import WALL_NS, write_frame, write_truth

SIMULATION = parse("simulated://sheet?tof=32x24&color=32x24&sensors=tof,color").build()
CAMERAS = {name: head.camera for name, head in SIMULATION.heads.items()}
BOOT_NS = 3_000_000_000


def recorded(count: int) -> list[Frame | Truth]:
    items: list[Frame | Truth] = []
    for k in range(count):
        frames, truth = SIMULATION.expose(k)
        items += [dataclasses.replace(item, t_host_ns=item.t_host_ns + BOOT_NS) for item in (truth, *frames)]
    return items


def write_item(file: McapFile, item: Frame | Truth) -> None:
    write_truth(file, item) if isinstance(item, Truth) else write_frame(file, item)


def write_model(file: McapFile, sensor: str, camera: Camera, **changes: object) -> None:
    model = sensor_metadata.sensor_model(Header(), sensor, camera, {"type": "gaussian_polynomial"})
    for name, value in changes.items():
        setattr(model, name, value)
    file.write(f"/{sensor}/model", model.DESCRIPTOR.full_name, model.SerializeToString(), WALL_NS, 0)


def write(
    path: Path, items: Iterable[Frame | Truth], *, finish: bool = True, sensors: tuple[str, ...] = ("tof", "color")
) -> Path:
    with path.open("wb") as stream:
        file = McapFile(stream, Compression.LZ4, chunk_size=20_000)
        file.attach("rig.toml", "text/toml", b'name = "demo"\n', WALL_NS)
        for sensor in sensors:
            write_model(file, sensor, CAMERAS[sensor])
        for item in items:
            write_item(file, item)
        file.finish() if finish else file.flush()
    return path


def write_malformed(path: Path, items: Iterable[Frame | Truth]) -> Path:
    """Writes a recording like `write`, with a malformed colour image in its middle."""
    items = list(items)
    with path.open("wb") as stream:
        file = McapFile(stream)
        for sensor, camera in CAMERAS.items():
            write_model(file, sensor, camera)
        for number, item in enumerate(items):
            if number == len(items) // 2:
                frame = next(one for one in items if isinstance(one, Frame) and one.sensor == "color")
                info = codec.encode_info(frame, Header())
                file.write("/color/color/image", codec.IMAGE_SCHEMA, b"\xff\xff", WALL_NS, 99)
                file.write("/color/color/info", codec.INFO_SCHEMA, info, WALL_NS, 99)
            write_item(file, item)
        file.finish()
    return path


def damage(path: Path) -> None:
    whole = bytearray(path.read_bytes())
    inside = scan(path).chunks[5].offset + 1000
    whole[inside : inside + 50] = bytes(50)
    path.write_bytes(whole)
