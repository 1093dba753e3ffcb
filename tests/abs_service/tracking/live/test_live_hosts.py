"""A live tracker on another host than the cameras: reboots, clocks, ages."""

import dataclasses

import numpy as np
import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState

from abs_service.bus.clock_offsets import answer
from abs_service.bus.stamps import HeaderFactory, WallClock
from drivers.contract.frame import Kind
from tests.abs_service.tracking.live.live_tracker_bench import MEMBERS, SIMULATION, Bench


@pytest.fixture
def bench():
    return Bench()


class Elsewhere:
    """The cameras of a bench are on another host.

    Args:
        bench: where the tracker runs.
        behind_ns: how far that host's clock is behind ours.
        boot: which boot of that host.
    """

    def __init__(self, bench, behind_ns, boot="first-boot"):
        self._bench, self._behind_ns = bench, behind_ns
        bench.capture = HeaderFactory("demo", bench.wall, host=boot)

    def expose(self, k, **given):
        self._bench.expose(k, self._shift, **given)

    def _shift(self, frame):
        times = {name: getattr(frame, name) - self._behind_ns for name in ("t_host_ns", "t_arrival_ns")}
        return dataclasses.replace(frame, **times, epoch=max(frame.t_host_ns - self._behind_ns, 0) // 10**8)


def test_estimates_go_on_after_a_reboot_of_the_capture_host(bench):
    cameras = Elsewhere(bench, -(10**15))
    for k in range(3):
        cameras.expose(k)
        bench.live.process_next()
    cameras = Elsewhere(bench, -(10**10), boot="second-boot")
    for k in range(3, 6):
        cameras.expose(k)
        bench.live.process_next()
    assert [state.status for state in bench.states] == 6 * [DeformationState.STATUS_TRACKING]
    assert [state.mesh_version for state in bench.states] == [1, 1, 1, 2, 2, 2]


def test_a_tracker_whose_clock_is_far_ahead_waits_for_all_sensors(bench):
    depth = next(kind for kind in Kind if kind.value == MEMBERS[0][1])
    cameras = Elsewhere(bench, 2000 * 10**9)
    for k in range(3):
        cameras.expose(k, kinds=(depth,))
        bench.live.process_next()
        cameras.expose(k, kinds=set(Kind) - {depth})
        bench.live.process_next()
    assert len(bench.states) == 3
    assert not any(sensor.missing for state in bench.states for sensor in state.sensors)


def test_the_age_across_hosts_is_unknown_until_their_clocks_are_compared(bench):
    cameras, behind_ns = Elsewhere(bench, 2000 * 10**9), 2000 * 10**9
    there = WallClock(monotonic=lambda: bench.now_ns - behind_ns, wall=lambda: 0)
    answer(bench.bus, HeaderFactory("demo", there, host="first-boot"))
    for k in range(2):
        cameras.expose(k)
        bench.now_ns += 7_000_000
        bench.live.process_next()
        bench.clocks.measure()
    before, after = bench.states
    assert np.isnan([before.age_ms, before.age_error_ms]).all()
    assert after.age_ms == pytest.approx(7)
    assert after.age_error_ms == pytest.approx(0, abs=0.1)
    assert (after.header.host_clock, after.header.t_host_ns) == ("first-boot", SIMULATION.time_ns(1) - behind_ns)
    assert after.header.stamp.ToNanoseconds() == 10**18 + SIMULATION.time_ns(1)
    assert bench.said.gauges["clock.offset_s"] == pytest.approx(2000)


def test_on_one_host_the_age_has_no_error(bench):
    bench.expose(0)
    bench.live.process_next()
    assert bench.states[0].age_error_ms == 0


def test_sensors_of_two_capture_hosts_are_paired_once_their_clocks_are_compared(bench):
    depth = next(kind for kind in Kind if kind.value == MEMBERS[0][1])
    behind_ns = 3600 * 10**9
    here, there = bench.capture, Elsewhere(bench, behind_ns, boot="colour-host")
    clock = WallClock(monotonic=lambda: bench.now_ns - behind_ns, wall=lambda: 0)
    elsewhere = bench.capture
    answer(bench.bus, HeaderFactory("demo", clock, host="colour-host"))
    for k in range(6):
        bench.capture = here
        bench.expose(k, kinds=(depth,))
        bench.capture = elsewhere
        there.expose(k, kinds=set(Kind) - {depth})
        bench.now_ns += 200_000_000
        bench.live.process_next()
        bench.clocks.measure()
    missing = [any(sensor.missing for sensor in state.sensors) for state in bench.states]
    assert missing[0]
    assert missing[-3:] == [False, False, False]
