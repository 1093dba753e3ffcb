"""Clock mapping: drift is separated from one-sided delays, wraps are unwrapped and steps are detected."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from drivers.contract.capabilities import ClockInfo
from drivers.contract.clock import DeviceClock, lower_line

KINECT = ClockInfo("kinect", 60e6, 32)
NANOSECONDS = ClockInfo("device", 1e9)
MS = 1e6

rng = np.random.default_rng


class Camera:
    """A 30 Hz camera whose clock drifts, with random one-sided delays."""

    def __init__(self, clock: ClockInfo, seed: int, drift_ppm: float, jitter_ms: float = 10.0) -> None:
        self.random = rng(seed)
        self.clock, self.jitter_ms = clock, jitter_ms
        self.hz = clock.tick_hz * (1 - drift_ppm * 1e-6)
        self.start_ns = int(self.random.integers(10**14))
        self.ticks = int(self.random.integers(2**32))
        self.mapping = DeviceClock(clock)
        self.stamps = []

    def take(self, k: float, ahead_ms: float = 0.0) -> float:
        """Error of the timestamp of the frame k periods after the first [ms]."""
        turn = 1 << (self.clock.bits or 63)
        ticks = (self.ticks + round((k / 30 + ahead_ms * 1e-3) * self.hz)) % turn
        exposure_ns = self.start_ns + k * 1e9 / 30
        arrival_ns = round(exposure_ns + self.random.exponential(self.jitter_ms * MS))
        self.stamps.append(self.mapping.stamp(ticks, arrival_ns))
        return (self.stamps[-1].t_host_ns - exposure_ns) / MS

    @property
    def steps(self) -> int:
        return sum(stamp.stepped for stamp in self.stamps)


@pytest.mark.parametrize("clock", [KINECT, NANOSECONDS])
def test_drift_is_separated_from_delay_within_ten_seconds(clock: ClockInfo) -> None:
    errors, sigmas, drifts = [], [], []
    for seed in range(40):
        drift = rng([seed, 1]).uniform(-200, 200)
        camera = Camera(clock, seed, drift)
        errors.append([camera.take(k) for k in range(330)][300:])
        sigmas.append(camera.stamps[-1].t_sigma_ns / MS)
        drifts.append(camera.mapping.gauges["drift_ppm"] - drift)
        assert camera.steps == 0
        assert camera.mapping.gauges["residual_ms"] == pytest.approx(10, rel=0.3)
    assert np.abs(errors).max() < 0.5
    assert np.sqrt(np.mean(np.square(errors))) < 0.15
    assert np.sqrt(np.mean(np.square(drifts))) < 30
    # It knows how well it does.
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) / np.mean(sigmas) < 1.5


@pytest.mark.parametrize("drift_ppm", [-200, 200])
def test_counter_wraps_and_long_pauses_do_not_affect_the_mapping(drift_ppm: float) -> None:
    camera = Camera(KINECT, 3, drift_ppm, jitter_ms=1.0)
    # Longer than the counter's 71.6 s, in one stretch; then two turns and a bit in silence.
    frames = [*range(0, 2700), *range(7000, 7300)]
    errors = np.array([camera.take(k) for k in frames])
    assert camera.steps == 0
    assert np.abs(errors[300:]).max() < 0.5
    assert camera.mapping.gauges["drift_ppm"] == pytest.approx(drift_ppm, abs=30)


@pytest.mark.parametrize("ahead_ms", [150.0, 5_000.0, -150.0, -60_000.0])
def test_a_clock_jump_is_one_step_and_the_mapping_recovers(ahead_ms: float) -> None:
    camera = Camera(NANOSECONDS, 4, 50, jitter_ms=2.0)
    before = [camera.take(k) for k in range(300)]
    after = [camera.take(k, ahead_ms) for k in range(300, 900)]
    assert camera.steps == 1
    assert camera.mapping.gauges["steps"] == 1
    assert np.abs(before[150:]).max() < 0.5
    assert np.abs(after[400:]).max() < 0.5


def test_a_host_busy_for_two_seconds_is_not_a_step() -> None:
    camera = Camera(NANOSECONDS, 5, 50, jitter_ms=1.0)
    for k in range(300):
        camera.take(k)
    arrival_ns = round(camera.start_ns + 360 * 1e9 / 30)
    for k in range(300, 360):
        stamp = camera.mapping.stamp(camera.ticks + round(k / 30 * camera.hz), arrival_ns)
        assert not stamp.stepped
        assert stamp.t_host_ns == pytest.approx(camera.start_ns + k * 1e9 / 30, abs=0.5 * MS)


def test_the_first_timestamp_has_a_large_sigma() -> None:
    camera = Camera(NANOSECONDS, 6, 0)
    camera.take(0)
    assert camera.stamps[0].t_sigma_ns > 3 * MS


def test_memory_is_bounded() -> None:
    camera = Camera(NANOSECONDS, 7, 0, jitter_ms=1.0)
    bytes_used = []
    for k in range(0, 30 * 600, 15):
        camera.take(k)
        if k % (30 * 300) == 30 * 299:
            bytes_used.append(len(pickle.dumps(camera.mapping)))
    assert bytes_used[1] == pytest.approx(bytes_used[0], rel=0.01)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 40))
def test_the_lower_line_is_the_linear_programming_solution(seed: int, number: int) -> None:
    random = rng(seed)
    x = np.sort(random.uniform(0, 10, number))
    y = random.exponential(3.0, number) + 0.2 * x
    pivot = float(random.uniform(x[0], x[-1]))
    slope, height = lower_line(x, y, pivot, 0.5)
    bounds = [(-0.5, 0.5), (None, None)]
    best = linprog([0, -1], np.column_stack([x - pivot, np.ones(number)]), y, bounds=bounds)
    assert best.success
    assert height == pytest.approx(best.x[1], abs=1e-9) or pivot in x
    assert np.all(height + slope * (x - pivot) <= y + 1e-9)
