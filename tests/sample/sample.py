"""Makes `recordings/sample.mcap` and writes down what the tracker finds in it.

    .venv/bin/python -m tests.sample.sample

The sample is free to share (CC0): the simulator's view of a sheet that begins to move, without a clock, so that
everybody who runs this gets the same images. `sample.json` holds Θ of every exposure. Make both anew only when the
simulator or the tracker was meant to change, and say why in the commit.
"""

import json
from pathlib import Path

import abs_service as a
from abs_service import config
from abs_service.bus import keys
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.capture import sensor_metadata
from abs_service.capture.mcap_writing import write_frame
from abs_service.config import ServiceConfig, plugins
from drivers.contract.device import Truth
from drivers.encoding import codec
from drivers.encoding.mcap_file import Compression, McapFile
from drivers.simulated.address import parse
from drivers.simulated.simulation import Simulation

SAMPLE = Path(__file__).parents[2] / "recordings" / "sample.mcap"
GOLDEN = Path(__file__).with_name("sample.json")
DEVICE = "simulated://sheet?seed=7&rate=15&tof=88x72&color=128x96"
#: From the last moments of rest until it moves at half its speed.
EXPOSURES = range(14, 29)
#: Wall-clock time at which the simulation starts [ns]: 2025-01-01 00:00:00 UTC.
START_NS = 1_735_689_600_000_000_000


def rig() -> ServiceConfig:
    """The demo rig with smaller images."""
    demo = config.load_default()
    device = demo.devices["sim"].model_copy(update={"uri": DEVICE})
    record = demo.record.model_copy(update={"directory": Path("recordings")})
    return demo.model_copy(update={"name": "sample", "devices": {"sim": device}, "record": record})


def write(path: Path, settings: ServiceConfig) -> None:
    """Writes the recording."""
    simulation = parse(DEVICE).build()
    headers = HeaderFactory(settings.name, WallClock(monotonic=lambda: 0, wall=lambda: START_NS), boot_id="sample")
    toml = config.to_toml(settings)
    with path.open("wb") as stream:
        file = McapFile(stream, Compression.ZSTD)
        file.attach("rig.toml", "text/toml", toml.encode(), START_NS)
        _write_metadata(file, settings, simulation, headers)
        for k in EXPOSURES:
            frames, truth = simulation.expose(k)
            _write_truth(file, truth, headers)
            for frame in frames:
                header = headers.at(frame.t_host_ns, frame.seq, frame.sensor)
                write_frame(file, frame, header, headers.clock.wall(frame.t_host_ns))
        file.finish()


def track(path: Path) -> list[list[float]]:
    """Θ of every exposure of a recording."""
    recording = a.open_recording(path)
    return [estimate.theta.tolist() for estimate in recording.rig.tracker("sheet").replay(recording)]


def _write_metadata(file: McapFile, settings: ServiceConfig, simulation: Simulation, headers: HeaderFactory) -> None:
    header = headers.at(0, 0)
    cameras = {name: head.camera for name, head in simulation.heads.items()}
    messages = {
        keys.CONFIG: sensor_metadata.config(header, config.to_toml(settings)),
        keys.TRANSFORMS: sensor_metadata.transforms(cameras, START_NS),
    }
    for name, camera in cameras.items():
        noise = settings.sensors[name].noise
        assert noise is not None
        messages[keys.model(name)] = sensor_metadata.sensor_model(header, name, camera, plugins.table(noise))
        messages[keys.calibration(name)] = sensor_metadata.calibration(name, camera, START_NS)
    for topic, message in messages.items():
        payload = message.SerializeToString(deterministic=True)
        file.write(f"/{topic}", message.DESCRIPTOR.full_name, payload, START_NS, 0)


def _write_truth(file: McapFile, truth: Truth, headers: HeaderFactory) -> None:
    payload = codec.encode_truth(truth, headers.at(truth.t_host_ns, truth.seq))
    wall_ns = headers.clock.wall(truth.t_host_ns)
    file.write(f"/{keys.truth('sim')}", codec.TRUTH_SCHEMA, payload, wall_ns, truth.seq)


if __name__ == "__main__":
    write(SAMPLE, rig())
    thetas = [[round(value, 7) for value in theta] for theta in track(SAMPLE)]
    GOLDEN.write_text(json.dumps({"theta": thetas}).replace("], [", "],\n[") + "\n", encoding="utf-8")
    print(f"{SAMPLE.name}: {SAMPLE.stat().st_size / 1e3:.0f} kB, {len(thetas)} estimates")
