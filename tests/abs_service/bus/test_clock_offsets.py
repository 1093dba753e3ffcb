"""Offsets between the clocks of hosts: never further off than they say."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.bus import keys
from abs_service.bus.clock_offsets import CLOCKS, READINGS, ClockOffsets, Offset, answer
from abs_service.bus.stamps import HeaderFactory, WallClock
from tests.abs_service.bus.loopback import LoopbackBus

S, MS = 1_000_000_000, 1_000_000


class TwoHosts(LoopbackBus):
    """Two hosts whose clocks differ, and a network that takes its time."""

    def __init__(self, ahead_ns=0, drift=0.0):
        super().__init__()
        self.now_ns = 10**15
        self.ahead_ns, self.drift = ahead_ns, drift
        self.delays_ns = (0, 0)
        there = WallClock(monotonic=self.there, wall=lambda: 0)
        answer(self, HeaderFactory("demo", there, host="there"))
        self.offsets = ClockOffsets(self, lambda: self.now_ns, "here")
        self.offsets.offset("there")

    def there(self):
        return self.now_ns + self.ahead_ns + round(self.drift * (self.now_ns - 10**15))

    def query(self, pattern, timeout_s):
        self.now_ns += self.delays_ns[0]
        answers = super().query(pattern, timeout_s)
        self.now_ns += self.delays_ns[1]
        return answers

    def measure(self, delays_ns):
        self.delays_ns = delays_ns
        self.offsets.measure()

    @property
    def known(self) -> Offset:
        known = self.offsets.offset("there")
        assert known is not None
        return known


DELAYS = st.integers(0, 300 * MS)


@given(
    ahead_ns=st.integers(-(10**16), 10**16),
    drift=st.floats(-100e-6, 100e-6),
    exchanges=st.lists(st.tuples(DELAYS, DELAYS, st.integers(0, 60 * S)), min_size=1, max_size=2 * READINGS),
)
def test_the_true_offset_is_within_the_error_whatever_the_network_and_the_clocks_do(ahead_ns, drift, exchanges):
    hosts = TwoHosts(ahead_ns, drift)
    for out_ns, back_ns, pause_ns in exchanges:
        hosts.measure((out_ns, back_ns))
        hosts.now_ns += pause_ns
        assert abs(hosts.known.ns - (hosts.now_ns - hosts.there())) <= hosts.known.error_ns + 1


def test_the_quickest_answer_counts_until_it_is_too_old():
    hosts = TwoHosts(5 * S)
    hosts.measure((MS, MS))
    hosts.measure((90 * MS, 10 * MS))
    assert hosts.known.ns == -5 * S
    assert hosts.known.error_ns < 1.1 * MS
    hosts.now_ns += 3600 * S
    assert hosts.known.error_ns > 1800 * MS, "clocks drift"
    hosts.measure((2 * MS, 2 * MS))
    assert hosts.known.error_ns < 2.01 * MS


def test_nothing_is_known_without_an_answer_and_nothing_needs_to_be_on_one_host():
    offsets = TwoHosts().offsets
    assert offsets.offset("elsewhere") is None
    offsets.measure()
    assert offsets.offset("elsewhere") is None
    assert offsets.offset("here") == offsets.offset("") == Offset(0, 0)


def test_after_a_reboot_of_the_other_host_the_old_offset_is_forgotten():
    hosts = TwoHosts(5 * S)
    hosts.measure((0, 0))
    assert hosts.offsets.offset("there, second boot") is None


def test_two_hosts_are_measured_and_no_more_than_the_last_few_that_were_asked_for():
    hosts = TwoHosts(5 * S)
    answer(hosts, HeaderFactory("demo", WallClock(monotonic=lambda: hosts.now_ns, wall=lambda: 0), host="third"))
    assert hosts.offsets.offset("third") is None
    hosts.measure((0, 0))
    third = hosts.offsets.offset("third")
    assert third is not None
    assert (hosts.known.ns, third.ns) == (-5 * S, 0)
    for number in range(CLOCKS):
        hosts.offsets.offset(f"invented-{number}")
    assert hosts.offsets.offset("third") is None


@pytest.mark.parametrize("payload", [b"\xff\xff", b""])
def test_an_answer_that_is_none_changes_nothing(payload):
    hosts = TwoHosts()
    hosts.answer_queries(keys.clock("there"), "absmsg.v1.Header", lambda: payload)
    hosts.measure((0, 0))
    assert hosts.offsets.offset("there") is None


def test_a_name_that_is_no_key_is_never_asked_for():
    hosts = TwoHosts()
    assert hosts.offsets.offset("**") is None
    hosts.offsets.measure()
    assert hosts.offsets.offset("**") is None
