"""Small recordings of the simulated device, intact and corrupt."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path

from absmsg.v1.common_pb2 import Header
from absmsg.v1.sensor_model_pb2 import SensorModel

from calib.camera import Camera
from drivers.contract.device import Truth
from drivers.contract.frame import Frame
from drivers.encoding import codec
from drivers.encoding.mcap_file import Compression, McapFile
from drivers.replay.contents import scan
from drivers.simulated.address import parse

SIMULATION = parse("simulated://sheet?tof=32x24&color=32x24&sensors=tof,color").build()
CAMERAS = {name: head.camera for name, head in SIMULATION.heads.items()}
WALL_NS = 1_700_000_000_000_000_000
BOOT_NS = 3_000_000_000


def recorded(count: int) -> list[Frame | Truth]:
    items: list[Frame | Truth] = []
    for k in range(count):
        frames, truth = SIMULATION.expose(k)
        items += [dataclasses.replace(item, t_host_ns=item.t_host_ns + BOOT_NS) for item in (truth, *frames)]
    return items


def write_item(file: McapFile, item: Frame | Truth) -> None:
    wall_ns = item.t_host_ns + WALL_NS
    header = Header(rig="demo", seq=item.seq)
    if isinstance(item, Truth):
        file.write("/sim/truth", codec.TRUTH_SCHEMA, codec.encode_truth(item, header), wall_ns, item.seq)
        return
    base = f"/{item.sensor}/{item.stream}"
    file.write(f"{base}/image", codec.IMAGE_SCHEMA, codec.encode_image(item, wall_ns), wall_ns, item.seq)
    file.write(f"{base}/info", codec.INFO_SCHEMA, codec.encode_info(item, header), wall_ns, item.seq)


def write_model(file: McapFile, sensor: str, camera: Camera, **changes: object) -> None:
    model = SensorModel(
        sensor=sensor,
        width=camera.width,
        height=camera.height,
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        lens=camera.lens.coefficients.tolist(),
        lens_model=camera.lens.name,
        T_rs=camera.T_rs.ravel().tolist(),
        noise="gaussian_polynomial",
    )
    for name, value in changes.items():
        setattr(model, name, value)
    file.write(f"/{sensor}/model", "absmsg.v1.SensorModel", model.SerializeToString(), WALL_NS, 0)


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


def damage(path: Path) -> None:
    whole = bytearray(path.read_bytes())
    inside = scan(path).chunks[5].offset + 1000
    whole[inside : inside + 50] = bytes(50)
    path.write_bytes(whole)
