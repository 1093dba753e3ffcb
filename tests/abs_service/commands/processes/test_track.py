"""`abs-service track` in this process, without cameras."""

import threading

import pytest

from abs_service import cli
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.capture.metadata_publisher import ConfiguredSensors, MetadataPublisher
from abs_service.commands.processes import track
from calib.camera import Camera

RIG = """
version = 1
name = "demo"
devices.cam.uri = "simulated://sheet"
sensors.tof.device = "cam"
sensors.tof.noise = { type = "constant", sigma = 0.005 }
synchronisation.reference = "tof/depth"
trackers.sheet.sensors = ["tof"]
trackers.sheet.model = { type = "nurbs", control_points = [4, 4], degree = 2 }
"""


def fails(*_):
    raise RuntimeError("no space left for the cache")


@pytest.fixture
def tracked(tmp_path, endpoint, open_bus, monkeypatch):
    """Runs it beside somebody who publishes a camera, for 10 s at most."""
    (tmp_path / "rig.toml").write_text(RIG)
    stop = threading.Event()
    monkeypatch.setattr(track.rig_process, "stop_on_signals", lambda: stop)
    metadata = MetadataPublisher(open_bus(), HeaderFactory("demo", WallClock()), ConfiguredSensors("", {"tof": {}}))
    metadata.add({"tof": Camera(160, 120, 200.0, 200.0, 79.5, 59.5)})

    def tracked():
        in_time = threading.Timer(10.0, stop.set)
        in_time.start()
        try:
            cli.main(["track", str(tmp_path / "rig.toml"), "--connect", endpoint])
        finally:
            in_time.cancel()

    return tracked


@pytest.mark.parametrize("part", ["load_compiler", "load_cached", "warm_up"])
def test_a_warm_up_that_fails_ends_the_tracker_with_its_error(tracked, monkeypatch, part):
    monkeypatch.setattr(track, "load_compiler", lambda: None)
    monkeypatch.setattr(track, "load_cached", lambda *_: False)
    monkeypatch.setattr(track, part, fails)
    with pytest.raises(RuntimeError, match="no space left for the cache"):
        tracked()


def test_it_begins_anew_until_it_is_stopped(tracked, monkeypatch):
    begun = []

    def track_until_another_calibration(bus, *_):
        begun.append(bus)
        if len(begun) == 2:
            track.rig_process.stop_on_signals().set()

    monkeypatch.setattr(track, "track_until_recalibrated", track_until_another_calibration)
    tracked()
    assert len(set(begun)) == 2
