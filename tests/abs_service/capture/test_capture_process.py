"""The real capture process: what a client of it sees, and how it ends."""

import queue
import signal
import time

import pytest
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.frames import FrameSubscriber
from abs_service.bus.health import Level
from abs_service.bus.session import SessionMode
from abs_service.bus.zenoh_bus import ZenohBus
from drivers.contract.host_clock import host_clock

pytestmark = [pytest.mark.slow, pytest.mark.realtime]  # starts an interpreter that imports and compiles everything


@pytest.fixture
def rig(tmp_path, endpoint):
    path = tmp_path / "rig.toml"
    path.write_text(
        f"""
version = 1
name = "demo"
bus.endpoint = "{endpoint}"
devices.sim.uri = "simulated://sheet?seed=1"
sensors.tof.device = "sim"
sensors.color.device = "sim"
"""
    )
    return path


def test_it_publishes_frames_and_answers_queries_until_sigterm(rig, endpoint, launch):
    with ZenohBus.open("demo", endpoint, SessionMode.ROUTER) as bus:
        changes, health = queue.SimpleQueue(), queue.SimpleQueue()
        bus.watch_liveliness(lambda *change: changes.put(change))
        bus.subscribe("health/capture", lambda sample: health.put(Health.FromString(sample.payload)))
        subscriber = FrameSubscriber(
            bus, [("tof", "depth"), ("tof", "amplitude"), ("color", "color")], time.monotonic_ns
        )
        process = launch("capture", rig, "--connect", endpoint)
        assert changes.get(timeout=60) == ("capture", True)
        seen = {}
        while len(seen) < 3:
            frame = subscriber.take(60)
            assert frame is not None
            seen[frame.key] = frame
        assert {sample.topic for sample in bus.query("**", 2)} == {
            *("config", "schema", "tf", keys.clock(host_clock())),
            *("tof/model", "tof/calibration", "color/model", "color/calibration"),
        }
        assert changes.empty(), "it is not alive for others any more"
        process.send_signal(signal.SIGTERM)
        assert process.wait(5) == 0
        assert changes.get(timeout=5) == ("capture", False)
        last = Health()
        while not health.empty():
            last = health.get()
        assert last.level == Level.OK
        assert last.labels["device.sim"] == "closed"
        assert last.counters["published.tof/depth/image"] > 0
