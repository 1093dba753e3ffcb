"""The synchroniser's promises, for any order, jitter and loss."""

from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.synchroniser import DEPTH
from drivers.contract.frame import FrameSet
from tests.abs_service.pairing.streams import AMPLITUDE, COLOR, MS, TOF, TOLERANCE, frame, synchroniser


@st.composite
def traffic(draw):
    """Frames of three streams with jitter, loss, repetition and any delay, in order of arrival; and a poll or not."""
    arrivals = []
    for key in (TOF, COLOR, AMPLITUDE):
        period = draw(st.sampled_from([15, 33, 40]))
        for seq in range(draw(st.integers(0, 25))):
            if draw(st.integers(0, 9)) == 0:
                continue
            t_ms = 1000 + seq * period + draw(st.integers(-5, 5))
            delay = draw(st.integers(0, 3) | st.integers(0, 120))
            copies = 2 if draw(st.integers(0, 19)) == 0 else 1
            arrivals += [(t_ms + delay, frame(key, t_ms, seq, epoch=seq // 20, late_ms=delay))] * copies
    return sorted(arrivals, key=lambda arrival: arrival[0]), draw(st.booleans())


@settings(max_examples=150, deadline=None)
@given(traffic())
def test_promises_hold_for_any_traffic(case):
    arrivals, polls = case
    sync = synchroniser(COLOR, AMPLITUDE, deadline_ns=50 * MS)
    sets: list[FrameSet] = []
    for t_ms, item in arrivals:
        sets += sync.add(item)
        if polls:
            sets += sync.poll(t_ms * MS)
    sets += sync.flush()

    used = [id(item) for formed in sets for item in formed.frames.values()]
    assert len(used) == len(set(used)), "a frame is in two sets"
    assert [formed.seq for formed in sets] == list(range(len(sets)))
    for earlier, later in pairwise(sets):
        assert earlier.stamp_ns < later.stamp_ns
        for key in earlier.frames.keys() & later.frames.keys():
            assert earlier.frames[key].t_host_ns < later.frames[key].t_host_ns
    for formed in sets:
        assert set(formed.frames) | set(formed.missing) == {TOF, COLOR, AMPLITUDE}
        assert not set(formed.frames) & set(formed.missing)
        differences = [abs(item.t_host_ns - formed.stamp_ns) for item in formed.frames.values()]
        assert formed.spread_ns == max(differences) <= TOLERANCE

    rejected = sum(number for cause, number in sync.counters.items() if cause.startswith("tof/depth."))
    assert len(sets) + rejected == sum(item.key == TOF for _, item in arrivals)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(-5, 5), min_size=2, max_size=30), st.randoms(use_true_random=False))
def test_streams_of_one_rate_are_matched_completely(jitter, random):
    """Two streams interleaved in any way: if nothing is lost, nothing is missing."""
    depth = [frame(TOF, 1000 + 33 * seq, seq) for seq in range(len(jitter))]
    color = [frame(COLOR, 1000 + 33 * seq + shift, seq) for seq, shift in enumerate(jitter)]
    sync = synchroniser()
    sets = []
    while depth or color:
        source = depth if not color or (depth and random.random() < 0.5) else color
        ahead = abs(len(depth) - len(color)) >= DEPTH
        sets += sync.add((max(depth, color, key=len) if ahead else source).pop(0))
    assert len(sets) == len(jitter)
    assert all(not formed.missing for formed in sets)
    assert sync.counters == {}
