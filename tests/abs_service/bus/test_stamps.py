from abs_service.bus.stamps import STEP_NS, HeaderFactory, WallClock


class Clocks:
    """A monotonic clock and a wall clock that somebody may set."""

    def __init__(self):
        self.now_ns, self.offset_ns = 1_000_000_000, 1_700_000_000_000_000_000

    def monotonic(self):
        self.now_ns += 100
        return self.now_ns

    def wall(self):
        return self.now_ns + self.offset_ns


def test_stamps_follow_the_monotonic_clock_until_the_offset_is_measured_anew():
    clocks = Clocks()
    clock = WallClock(clocks.monotonic, clocks.wall)
    before = clock.wall(5_000_000_000)
    assert abs(before - 5_000_000_000 - clocks.offset_ns) < 1000
    clocks.offset_ns -= 3_600_000_000_000
    assert clock.wall(5_000_000_001) == before + 1
    assert abs(clock.measure() + 3_600_000_000_000) < 1000
    assert abs(clock.wall(5_000_000_000) - 5_000_000_000 - clocks.offset_ns) < 1000
    assert clock.steps == 1


def test_slow_drift_is_followed_but_is_no_step():
    clocks = Clocks()
    clock = WallClock(clocks.monotonic, clocks.wall)
    for _ in range(10):
        clocks.offset_ns += STEP_NS // 2
        clock.measure()
    assert clock.steps == 0
    assert abs(clock.wall(0) - clocks.offset_ns) < 1000


def test_a_header_has_sender_and_time():
    clocks = Clocks()
    clock = WallClock(clocks.monotonic, clocks.wall)
    headers = HeaderFactory("demo", clock)
    header = headers.at(2_000_000_000, 7, "tof")
    assert header.stamp.ToNanoseconds() == clock.wall(2_000_000_000)
    assert (header.t_host_ns, header.seq, header.rig, header.frame_id) == (2_000_000_000, 7, "demo", "tof")
    assert header.boot_id == headers.boot_id != HeaderFactory("demo", clock).boot_id
