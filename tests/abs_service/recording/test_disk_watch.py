"""The forecast, and old recordings that are deleted while new ones are written."""

import math

import pytest
from absmsg.v1.health_pb2 import Health as HealthMessage

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.recording import forecast
from abs_service.recording.disk_watch import DiskWatch
from abs_service.recording.retention import Retention
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.abs_service.recording.test_retention import DAY_NS, NOW_NS, put, take

MB = 1_000_000


@pytest.mark.parametrize(
    ("rate", "room", "used", "retain_s", "retain_bytes", "expected"),
    [
        (45 * MB, 10_108_800 * MB, 0, math.inf, math.inf, "2.6 days on this disk"),
        (45 * MB, 500_000 * MB, 0, math.inf, math.inf, "3.1 hours on this disk"),
        (45 * MB, -1, 0, math.inf, math.inf, "0 s on this disk"),
        (45 * MB, 500_000 * MB, 0, 7200.0, math.inf, "the last 2.0 hours are kept"),
        (50 * MB, 500_000 * MB, 0, math.inf, 360_000 * MB, "the last 2.0 hours are kept"),
        (50 * MB, 300_000 * MB, 60_000 * MB, math.inf, 360_000 * MB, "the last 2.0 hours are kept"),
        (50 * MB, 30_000 * MB, 60_000 * MB, math.inf, 360_000 * MB, "10.0 min on this disk"),
        (0.0, 1, 0, math.inf, math.inf, ""),
    ],
)
def test_a_forecast(rate, room, used, retain_s, retain_bytes, expected):
    assert forecast.text(rate, room, used, retain_s, retain_bytes) == expected


def test_the_rate_is_that_of_the_last_minute():
    meter = forecast.RateMeter()
    assert meter.add(0, 0) == 0
    totals = [5.0 * second if second <= 30 else 150.0 + 2.0 * (second - 30) for second in range(1, 101)]
    rates = [meter.add(second * 10**9, total) for second, total in enumerate(totals, 1)]
    assert rates[-1] == 2.0


class Watch:
    """A disk watch with a clock and a disk of its own, which sees 10 MB/s written."""

    def __init__(self, folder, free, retain_s=math.inf, retain_bytes=math.inf):
        self.now_ns, self.jump_ns = 0, 0
        clock = WallClock(lambda: self.now_ns, lambda: NOW_NS + self.now_ns + self.jump_ns)
        self.clock, self.bus = clock, LoopbackBus()
        self.health = Health(self.bus, "record", HeaderFactory("demo", clock))
        retention = Retention(folder, "demo", retain_s, retain_bytes)
        self.watch = DiskWatch(retention, 0, self.health, clock, lambda folder: free)

    def pass_seconds(self, seconds):
        for _ in range(seconds):
            self.now_ns += 10**9
            self.clock.measure()
            self.watch.look(self.now_ns // 100)
        return health_now(self.health, self.bus)


def test_health_has_the_forecast_and_warns_in_the_last_hour(tmp_path):
    said = Watch(tmp_path, free=72_000 * 10 * MB).pass_seconds(30)
    assert (said.level, said.labels["forecast"]) == (HealthMessage.LEVEL_OK, "20.0 hours on this disk")
    said = Watch(tmp_path, free=1800 * 10 * MB).pass_seconds(30)
    assert (said.level, said.message) == (HealthMessage.LEVEL_WARNING, "the disk is full in 30.0 min")


def test_old_recordings_are_deleted_and_counted(tmp_path):
    for day in range(1, 8):
        put(tmp_path, take(day), 8 - day)
    said = Watch(tmp_path, 1, retain_s=4.5 * 86_400).pass_seconds(11)
    assert (said.counters["deleted"], said.labels["deleted"]) == (3, take(3))


def test_a_wall_clock_that_jumps_by_years_makes_no_recording_old(tmp_path):
    put(tmp_path, take(1), 1)
    watch = Watch(tmp_path, 1, retain_s=4.5 * 86_400)
    watch.jump_ns = 3000 * DAY_NS
    assert watch.pass_seconds(30).counters["deleted"] == 0


def test_what_cannot_be_deleted_is_said(tmp_path, monkeypatch):
    def refuse(path, missing_ok):
        raise PermissionError(1, "Operation not permitted")

    put(tmp_path, take(1), 7)
    monkeypatch.setattr("pathlib.Path.unlink", refuse)
    said = Watch(tmp_path, 10**15, retain_s=86_400).pass_seconds(1)
    assert said.message == "an old recording cannot be deleted: [Errno 1] Operation not permitted"


def test_without_a_folder_there_is_no_forecast(tmp_path):
    watch = Watch(tmp_path, 1)
    watch.watch = DiskWatch(Retention(tmp_path / "gone", "demo", 1.0, 1.0), 0, watch.health, watch.clock)
    assert watch.pass_seconds(30).labels["forecast"] == ""
