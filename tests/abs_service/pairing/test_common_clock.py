"""Frames of two hosts are paired by their true times, and never when the offset says too little."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.bus.clock_offsets import Offset
from abs_service.pairing.common_clock import CommonClock
from abs_service.pairing.synchroniser import Synchroniser
from tests.abs_service.pairing.streams import COLOR, MS, TOF, TOLERANCE, frame

PERIOD_MS = 33
HOUR_NS = 3600 * 10**9


class TwoHosts:
    """Depth of one host, colours of another, whose clock is `ahead_ns` at first and gains `drift`."""

    def __init__(self, ahead_ns=HOUR_NS, drift=0.0, wrong_ns=0, error_ns=0):
        self.ahead_ns, self.drift, self.wrong_ns, self.error_ns = ahead_ns, drift, wrong_ns, error_ns
        self.t_ns = 0
        self.clock = CommonClock(TOF, TOLERANCE, self.offset)
        self.synchroniser = Synchroniser(TOF, [TOF, COLOR], TOLERANCE)

    def offset(self, host_clock):
        if host_clock == "depth host":
            return Offset(0, 0)
        return Offset(-self.ahead_of(self.t_ns) + self.wrong_ns, self.error_ns)

    def ahead_of(self, t_ns):
        return self.ahead_ns + round(self.drift * t_ns)

    def sets(self, times_ms, late_ms=5):
        formed = []
        for t_ms in times_ms:
            depth = replace(frame(TOF, t_ms, late_ms=40), host_clock="depth host")
            color = frame(COLOR, t_ms + late_ms, late_ms=40)
            by_ns = self.ahead_of(color.t_host_ns)
            shifted = {"t_host_ns": color.t_host_ns + by_ns, "t_arrival_ns": color.t_arrival_ns + by_ns}
            self.t_ns = depth.t_host_ns
            for one in (depth, replace(color, **shifted, host_clock="colour host")):
                if (converted := self.clock.convert(one)) is not None:
                    formed += self.synchroniser.add(*converted)
        return formed


def times_ms(count, start_ms=1000):
    return range(start_ms, start_ms + count * PERIOD_MS, PERIOD_MS)


@settings(max_examples=30)
@given(
    ahead_ns=st.integers(-HOUR_NS, HOUR_NS),
    drift=st.floats(-100e-6, 100e-6),
    error_ms=st.integers(0, PERIOD_MS // 2),
    share=st.floats(-1, 1),
)
def test_frames_of_one_moment_are_paired_whatever_the_clocks_and_the_error_within_its_bound(
    ahead_ns, drift, error_ms, share
):
    hosts = TwoHosts(ahead_ns, drift, round(share * error_ms * MS), error_ms * MS)
    sets = hosts.sets(times_ms(60), late_ms=0)
    paired = [one for one in sets if not one.missing]
    assert len(paired) >= 57  # all but those before the first interval and at the end
    assert all(one.frames[TOF].seq == one.frames[COLOR].seq for one in paired)


def test_a_pair_is_told_on_the_clock_of_the_reference():
    hosts = TwoHosts()
    formed = hosts.sets(times_ms(4))[-1]
    assert formed.host_clock == "depth host"
    assert formed.spread_ns == 5 * MS
    assert formed.frames[COLOR].t_host_ns == formed.stamp_ns + 5 * MS


@pytest.mark.parametrize(("error_ms", "is_paired"), [(0, False), (4, True)])
def test_the_tolerance_grows_by_the_error(error_ms, is_paired):
    hosts = TwoHosts(error_ns=error_ms * MS)
    sets = hosts.sets(times_ms(10), late_ms=15)
    assert any(not one.missing for one in sets) == is_paired


def test_an_offset_that_is_less_certain_than_half_the_frame_period_pairs_nothing_and_says_so():
    hosts = TwoHosts(error_ns=40 * MS)
    sets = hosts.sets(times_ms(10)) + hosts.synchroniser.flush()
    assert len(sets) == 10
    assert all(one.missing == (COLOR,) for one in sets)
    assert hosts.clock.counters == {"color/color.uncertain_clock": 10}
    assert hosts.clock.doubt.startswith(
        "color: the clock of its host is known to ± 40.0 ms, more than half the frame period of 33.0 ms"
    )
    hosts.error_ns = MS
    hosts.sets(times_ms(3, 2000))
    assert hosts.clock.doubt == ""


def test_frames_of_an_unknown_clock_are_left_to_the_synchroniser_which_counts_them():
    clock = CommonClock(TOF, TOLERANCE, lambda _: None)
    clock.convert(replace(frame(TOF, 100), host_clock="depth host"))
    color = replace(frame(COLOR, 100), host_clock="colour host")
    assert clock.convert(color) == (color, 0)
