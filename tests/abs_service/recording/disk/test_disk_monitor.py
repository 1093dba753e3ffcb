"""The forecast, and old recordings that are deleted while new ones are written."""

import math
import os
import threading

import pytest
from absmsg.v1.health_pb2 import Health as HealthMessage

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.recording.disk import disk_monitor, forecast
from abs_service.recording.disk.disk_monitor import DiskMonitor
from abs_service.recording.disk.forecast import Growth
from abs_service.recording.disk.retention import Retention
from abs_service.recording.recording_file import ESTIMATES
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.abs_service.recording.disk.test_retention import DAY_NS, NOW_NS, put, take
from tests.waiting import eventually

MB = 1_000_000


@pytest.mark.parametrize(
    ("rate", "room", "used", "retain_s", "retain_bytes", "expected"),
    [
        (45 * MB, 10_108_800 * MB, 0, math.inf, math.inf, "2.6 days on this disk"),
        (45 * MB, 500_000 * MB, 0, math.inf, math.inf, "3.1 hours on this disk"),
        (45 * MB, -1, 0, math.inf, math.inf, forecast.NO_ROOM),
        (45 * MB, 500_000 * MB, 0, 7200.0, math.inf, "the last 2.0 hours are kept"),
        (50 * MB, 500_000 * MB, 0, math.inf, 360_000 * MB, "the last 2.0 hours are kept"),
        (50 * MB, 300_000 * MB, 60_000 * MB, math.inf, 360_000 * MB, "the last 2.0 hours are kept"),
        (50 * MB, 30_000 * MB, 60_000 * MB, math.inf, 360_000 * MB, "10.0 min on this disk" + forecast.TOO_SMALL),
        (0.0, 1, 0, math.inf, math.inf, ""),
    ],
)
def test_a_forecast(rate, room, used, retain_s, retain_bytes, expected):
    recordings = Growth(rate, used, retain_s, retain_bytes)
    assert forecast.text(recordings, Growth(0.0, 0, math.inf, math.inf), room) == expected


@pytest.mark.parametrize(
    ("rotate_bytes", "retain_s", "retain_bytes", "expected"),
    [
        (4_000 * MB, 3600.0, math.inf, "the last 60.0 min are kept"),
        (9_000 * MB, 3600.0, math.inf, "62.2 min on this disk" + forecast.TOO_SMALL),  # the oldest is 200 s long
        (9_000 * MB, math.inf, 1_000 * MB, "the last 22 s are kept"),
        (900_000 * MB, math.inf, 1_000 * MB, "62.2 min on this disk" + forecast.TOO_SMALL),  # within one file
    ],
)
def test_a_file_that_is_written_is_not_deleted(tmp_path, rotate_bytes, retain_s, retain_bytes, expected):
    kept = Retention(tmp_path, "demo", "", retain_s, retain_bytes, math.inf, rotate_bytes)
    assert forecast.text(kept.growth(45 * MB), Growth(0.0, 0, math.inf, math.inf), 168_000 * MB) == expected


@pytest.mark.parametrize(
    ("retain_s", "retain_bytes", "expected"),
    [
        (math.inf, math.inf, "2.8 hours on this disk"),  # nothing is deleted: 50 MB/s
        (3600.0, math.inf, "19.0 hours on this disk"),  # 180 GB in the first hour, then estimates alone: 5 MB/s
        (3600.0, 180_000 * MB, "the last 60.0 min are kept, estimates of 10.0 hours"),
    ],
)
def test_estimates_that_are_kept_for_longer_fill_the_disk_later(retain_s, retain_bytes, expected):
    recordings, estimates = Growth(45 * MB, 0, retain_s, math.inf), Growth(5 * MB, 0, math.inf, retain_bytes)
    assert forecast.text(recordings, estimates, 504_000 * MB) == expected


def test_the_forecast_is_when_a_disk_written_second_by_second_is_full():
    kinds = Growth(7.0, 40, 30.0, math.inf), Growth(2.0, 0, math.inf, 500.0), Growth(0.0, 9, math.inf, math.inf)
    room, seconds, used = 600.0, 0, [kind.used for kind in kinds]
    while sum(used) - sum(kind.used for kind in kinds) < room:
        seconds += 1
        used = [min(size + k.rate, max(k.used, k.used + k.more)) for size, k in zip(used, kinds)]
    assert seconds == math.ceil(forecast.room_s(kinds, room))
    assert forecast.room_s(kinds, room + 100) == math.inf


def test_the_rate_is_that_of_the_last_minute():
    meter = forecast.RateMeter()
    assert meter.add(0, 0) == 0
    totals = [5.0 * second if second <= 30 else 150.0 + 2.0 * (second - 30) for second in range(1, 101)]
    rates = [meter.add(second * 10**9, total) for second, total in enumerate(totals, 1)]
    assert rates[-1] == 2.0


def test_the_time_before_the_first_byte_is_no_part_of_the_rate():
    meter = forecast.RateMeter()
    assert [meter.add(second * 10**9, 0.0) for second in range(40)] == [0.0] * 40
    assert meter.add(40 * 10**9, 7.0) == 7.0


class Bench:
    """A disk monitor with a clock and a disk of its own, which sees 10 MB/s written."""

    def __init__(self, folder, free, retain_s=math.inf, retain_bytes=math.inf):
        self.now_ns, self.jump_ns, self.is_synchronised = 0, 0, True
        clock = WallClock(lambda: self.now_ns, lambda: NOW_NS + self.now_ns + self.jump_ns)
        self.clock, self.bus = clock, LoopbackBus()
        self.health = Health(self.bus, "record", HeaderFactory("demo", clock))
        recordings = Retention(folder, "demo", "", retain_s, retain_bytes)
        estimates = Retention(folder, "demo", ESTIMATES, math.inf, math.inf)
        follows = lambda: self.is_synchronised  # noqa: E731
        self.monitor = DiskMonitor(recordings, estimates, 0, self.health, clock, lambda folder: free, follows)

    def pass_seconds(self, seconds):
        for _ in range(seconds):
            self.now_ns += 10**9
            self.clock.measure()
            self.monitor.check((self.now_ns // 100, 0))
        return health_now(self.health, self.bus)


def test_health_has_the_forecast_and_warns_in_the_last_hour(tmp_path):
    said = Bench(tmp_path, free=72_000 * 10 * MB).pass_seconds(30)
    assert (said.level, said.labels["forecast"]) == (HealthMessage.LEVEL_OK, "20.0 hours on this disk")
    said = Bench(tmp_path, free=1800 * 10 * MB).pass_seconds(30)
    assert (said.level, said.message) == (HealthMessage.LEVEL_WARNING, "the disk is full in 30.0 min")


def test_old_recordings_are_deleted_and_counted(tmp_path):
    for day in range(1, 8):
        put(tmp_path, take(day), 8 - day)
    said = Bench(tmp_path, 1, retain_s=4.5 * 86_400).pass_seconds(11)
    assert (said.counters["deleted"], said.labels["deleted"]) == (3, take(3))


def test_estimates_outlive_their_recordings(tmp_path):
    names = (take(1), take(1).replace(".mcap", "_estimates.mcap"))
    for name in names:
        put(tmp_path, name, 7)
    Bench(tmp_path, 1, retain_s=86_400).pass_seconds(11)
    assert [path.name for path in tmp_path.iterdir()] == [names[1]]


#: An hour that the time zone was wrong, a year, and to 1970 [days].
STEPS = (1 / 24, -1 / 24, 365, -NOW_NS / DAY_NS)


@pytest.mark.parametrize("days", STEPS)
def test_no_step_of_the_wall_clock_makes_a_recording_older_or_younger(tmp_path, days):
    bench = Bench(tmp_path, 1, retain_s=60.0)
    put(tmp_path, take(1), 20 / 86_400)
    bench.pass_seconds(11)
    bench.jump_ns = int(days * DAY_NS)
    assert bench.pass_seconds(20).counters["deleted"] == 0
    assert bench.pass_seconds(20).counters["deleted"] == 1


@pytest.mark.parametrize("days", STEPS)
def test_what_is_recorded_after_a_step_of_the_wall_clock_is_the_newest(tmp_path, days):
    for day in (1, 2, 3):
        put(tmp_path, take(day), 8 - day)
    bench = Bench(tmp_path, 1, retain_bytes=400)
    bench.pass_seconds(11)
    for day in (4, 5):
        active = put(tmp_path, take(day) + ".active", -days)
        bench.pass_seconds(10)
        active.rename(tmp_path / take(day))
    bench.pass_seconds(10)
    assert sorted(path.name for path in tmp_path.iterdir()) == [take(day) for day in (2, 3, 4, 5)]


def test_a_clock_of_2099_deletes_nothing_until_it_follows_a_time_server(tmp_path):
    for day in range(1, 8):
        put(tmp_path, take(day), 8 - day)
    bench = Bench(tmp_path, 10**15, retain_s=4.5 * 86_400)
    bench.is_synchronised, bench.jump_ns = False, 26_663 * DAY_NS
    said = bench.pass_seconds(30)
    assert (said.counters["deleted"], said.level) == (2, HealthMessage.LEVEL_WARNING)
    assert said.message.startswith("nothing was recorded for 26664.0 days, by a clock that follows no time server")
    put(tmp_path, take(8), -26_663)  # of this recorder, and now another one is started
    again = Bench(tmp_path, 10**15, retain_s=4.5 * 86_400)
    again.is_synchronised, again.jump_ns = False, 26_663 * DAY_NS
    assert again.pass_seconds(30).counters["deleted"] == 0
    again.is_synchronised, again.jump_ns = True, 0
    said = again.pass_seconds(30)
    assert (said.counters["deleted"], said.level) == (1, HealthMessage.LEVEL_OK)


def test_a_recording_is_as_old_as_its_end(tmp_path):
    bench = Bench(tmp_path, 1, retain_s=60.0)
    active = put(tmp_path, take(1) + ".active")
    bench.pass_seconds(300)
    active.rename(tmp_path / take(1))
    assert bench.pass_seconds(50).counters["deleted"] == 0
    assert bench.pass_seconds(30).counters["deleted"] == 1


def test_what_cannot_be_deleted_does_not_keep_the_others(tmp_path, monkeypatch):
    def unlink(path, missing_ok):
        if path.name == take(1):
            raise PermissionError(1, "Operation not permitted")
        os.unlink(path)

    for day in (1, 2, 3):
        put(tmp_path, take(day), 8 - day)
    monkeypatch.setattr("pathlib.Path.unlink", unlink)
    said = Bench(tmp_path, 10**15, retain_s=86_400).pass_seconds(1)
    assert (said.counters["deleted"], "Operation not permitted" in said.message) == (2, True)


def test_what_cannot_be_deleted_is_said(tmp_path, monkeypatch):
    def refuse(path, missing_ok):
        raise PermissionError(1, "Operation not permitted")

    put(tmp_path, take(1), 7)
    monkeypatch.setattr("pathlib.Path.unlink", refuse)
    said = Bench(tmp_path, 10**15, retain_s=86_400).pass_seconds(1)
    assert said.message == "an old recording cannot be deleted: [Errno 1] Operation not permitted"


def test_without_a_folder_there_is_no_forecast(tmp_path):
    bench = Bench(tmp_path, 1)
    gone = Retention(tmp_path / "gone", "demo", "", 1.0, 1.0)
    bench.monitor = DiskMonitor(gone, gone, 0, bench.health, bench.clock)
    assert bench.pass_seconds(30).labels["forecast"] == ""


def test_a_folder_that_takes_long_to_read_is_read_less_often(tmp_path):
    bench, checks = Bench(tmp_path, 1), []

    def slow(folder):
        checks.append(bench.now_ns)
        bench.now_ns += 3 * 10**9
        return 1

    kept = Retention(tmp_path, "demo", "", 1.0, 1.0)
    bench.monitor = DiskMonitor(kept, kept, 0, bench.health, bench.clock, slow)
    bench.pass_seconds(130)
    assert [t_ns // 10**9 for t_ns in checks] == [1, 64, 127]


def test_whoever_waits_for_the_disk_is_not_the_recorder_and_mistakes_of_ours_are_said(tmp_path, monkeypatch):
    monkeypatch.setattr(disk_monitor, "CHECK_S", 0.001)
    bench, stop, checks = Bench(tmp_path, 1), threading.Event(), []

    def check(written):
        checks.append(written)
        if len(checks) == 1:
            raise ZeroDivisionError("ours")
        stop.wait()

    monkeypatch.setattr(bench.monitor, "check", check)
    bench.monitor.start(lambda: (5, 7), stop)
    assert eventually(lambda: len(checks) == 2)
    stop.set()
    assert checks == [(5, 7), (5, 7)]
    assert health_now(bench.health, bench.bus).message == "ZeroDivisionError: ours"
