"""The synchroniser forms sets, says what is missing and counts what it cannot use."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.pairing.synchroniser import DEPTH
from abs_service.pairing.waiting_stream import FOREIGN
from drivers.contract.frame import Reference
from tests.abs_service.pairing.streams import AMPLITUDE, COLOR, MS, TOF, frame, synchroniser


def test_a_set_is_formed_by_the_last_member_within_tolerance():
    sync = synchroniser(COLOR, AMPLITUDE)
    depth, color, amplitude = frame(TOF, 100), frame(COLOR, 108), frame(AMPLITUDE, 100)
    assert sync.add(depth) == []
    assert sync.add(color) == []
    (formed,) = sync.add(amplitude)
    assert formed.frames == {TOF: depth, COLOR: color, AMPLITUDE: amplitude}
    assert (formed.seq, formed.stamp_ns, formed.missing, formed.spread_ns) == (0, 100 * MS, (), 8 * MS)
    assert sync.counters == {}


def test_stamps_of_start_and_end_are_compared_in_the_middle_of_the_exposures():
    sync = synchroniser()
    first = replace(frame(TOF, 100, late_ms=50), t_reference=Reference.START, exposure_s=0.02, tick_hz=1000.0)
    sync.add(first)
    (formed,) = sync.add(replace(frame(COLOR, 130, late_ms=50), t_reference=Reference.END, exposure_s=0.03))
    assert (formed.stamp_ns, formed.spread_ns) == (110 * MS, 5 * MS)
    depth = formed.frames[TOF]
    assert (depth.t_host_ns, depth.t_device_ticks, depth.t_reference) == (110 * MS, 10, Reference.MIDDLE)


def test_stamps_without_a_known_exposure_stay_as_they_are():
    sync = synchroniser()
    for exposure_s in (np.nan, -1.0, 1e9):
        late = replace(frame(TOF, 100), t_reference=Reference.END, exposure_s=exposure_s)
        assert late.at_middle() is late
    sync.add(late)
    (formed,) = sync.add(frame(COLOR, 108))
    assert formed.stamp_ns == 100 * MS


def test_a_member_that_is_past_the_tolerance_is_named_missing_at_once():
    sync = synchroniser()
    sync.add(frame(TOF, 100))
    (formed,) = sync.add(frame(COLOR, 113))
    assert formed.missing == (COLOR,)
    assert list(formed.frames) == [TOF]
    (later,) = sync.add(frame(TOF, 120))
    assert later.frames[COLOR].seq == 113


def test_the_nearest_of_several_members_is_taken_and_the_others_are_counted():
    sync = synchroniser()
    for t_ms in (91, 97, 104, 110):
        sync.add(frame(COLOR, t_ms))
    (formed,) = sync.add(frame(TOF, 98))
    assert formed.frames[COLOR].seq == 97
    assert sync.counters == {"color/color.unmatched": 1}


def test_the_deadline_counts_from_the_arrival_of_the_reference():
    sync = synchroniser(deadline_ns=50 * MS)
    sync.add(frame(TOF, 100, late_ms=30))
    assert sync.poll(179 * MS) == []
    (formed,) = sync.poll(180 * MS)
    assert formed.missing == (COLOR,)


def test_a_silent_stream_is_waited_for_once_and_again_after_it_delivers():
    sync = synchroniser(deadline_ns=50 * MS)
    sync.add(frame(TOF, 100))
    assert len(sync.poll(150 * MS)) == 1
    sync.add(frame(TOF, 133))
    assert len(sync.poll(134 * MS)) == 1, "a silent stream must not delay every set by the deadline"
    sync.add(frame(COLOR, 133))
    assert sync.counters == {}, "it may still match a reference frame that comes late"
    sync.add(frame(TOF, 166))
    assert sync.poll(167 * MS) == []
    assert sync.add(frame(COLOR, 166))[0].missing == ()


@pytest.mark.parametrize(
    ("second", "cause"),
    [
        (frame(TOF, 100), "duplicate"),
        (frame(TOF, 100, seq=7), "duplicate"),
        (frame(TOF, 133, seq=100), "duplicate"),
        (frame(TOF, 133, size=(3, 2)), "changed"),
        (replace(frame(TOF, 133), data=np.zeros((2, 3), "<f4"), encoding="32FC1"), "changed"),
        (frame(TOF, 133, epoch=4), "old_epoch"),
        (frame(TOF, 133, late_ms=-20), "future"),
        (frame(("other", "depth"), 133), "unexpected"),
    ],
)
def test_what_cannot_be_used_is_rejected_and_counted(second, cause):
    sync = synchroniser()
    sync.add(replace(frame(TOF, 100), epoch=5))
    if cause != "old_epoch":
        second = replace(second, epoch=5)
    assert sync.add(second) == []
    assert sync.counters == {f"{second.sensor}/{second.stream}.{cause}": 1}
    assert len(sync.flush()) == 1


def test_a_frame_older_than_what_left_is_stale():
    sync = synchroniser()
    sync.add(frame(COLOR, 100))
    sync.add(frame(TOF, 100))
    assert sync.add(frame(TOF, 99)) == []
    assert sync.add(frame(COLOR, 99)) == []
    assert sync.counters == {"tof/depth.stale": 1, "color/color.stale": 1}


def test_a_new_epoch_may_count_anew_and_have_another_size():
    sync = synchroniser()
    sync.add(frame(TOF, 100, seq=1))
    sync.add(frame(COLOR, 100))
    sync.add(frame(TOF, 133, seq=1, epoch=1, size=(4, 4)))
    (formed,) = sync.add(frame(COLOR, 133))
    assert formed.frames[TOF].data.shape == (4, 4)
    assert sync.counters == {}


def test_a_stream_that_changes_within_its_epoch_is_used_again():
    sync = synchroniser()
    sets = sync.group(frame(TOF, 33 * k, size=(2, 3) if k < 5 else (4, 4)) for k in range(5 + 2 * FOREIGN))
    assert [formed.frames[TOF].data.shape for formed in sets] == 5 * [(2, 3)] + FOREIGN * [(4, 4)]
    assert sync.counters == {"tof/depth.changed": FOREIGN}


def test_stamps_of_the_future_are_said_until_they_are_right():
    sync = synchroniser()
    said = []
    for k in range(60):
        sync.add(frame(COLOR, 33 * k, late_ms=-3_600_000 if 10 <= k < 30 else 0))
        said.append(sync.doubt)
    assert [bool(text) for text in said] == 24 * [False] + 6 * [True] + 30 * [False]
    assert said[29].startswith("color/color: its time stamps are ahead of the arrival")
    assert sync.counters["color/color.future"] == 20


@pytest.mark.parametrize("key", [TOF, COLOR])
def test_a_stream_whose_stamps_alternate_is_said_until_they_are_right(key):
    sync = synchroniser()
    said = []
    for k in range(120):
        back_ms = 1000 if 30 <= k < 80 and k % 2 else 0
        for one in (COLOR, TOF):
            sync.add(frame(one, 3000 + 33 * k - (back_ms if one == key else 0), seq=k))
        said.append(sync.doubt)
    assert [bool(text) for text in said[:59]] == 59 * [False]
    sensor, stream = key
    assert said[70].startswith(f"{sensor}/{stream}: 15 of its last 30 frames are not used, because their time stamps")
    assert said[-1] == ""
    assert sync.counters[f"{sensor}/{stream}.stale"] == 25


def test_frames_that_come_after_their_sets_are_said():
    sync = synchroniser(deadline_ns=100 * MS)
    for k in range(60):
        sync.add(frame(TOF, 33 * k))
        sync.poll((33 * k + 110) * MS)
        sync.add(frame(COLOR, 33 * (k - 6), seq=k))
    assert sync.doubt.startswith("color/color: 30 of its last 30 frames are not used")


def elsewhere(key, t_s, host, *, epoch=0, received_s=0.0):
    """A frame of another host's clock that comes here at a time of our clock."""
    made = frame(key, t_s * 1000, epoch=epoch)
    return replace(made, host_clock=host, t_received_ns=int(received_s * 1e9))


def test_after_a_reboot_of_the_capture_host_sets_are_formed_on_its_new_clock():
    sync = synchroniser()
    sync.add(elsewhere(TOF, 9_000, "first boot", epoch=90_000))
    assert sync.add(elsewhere(COLOR, 50, "second boot", epoch=500)) == [], "the reference decides"
    (last,) = sync.add(elsewhere(TOF, 50.033, "second boot", epoch=500))
    assert (last.stamp_ns, last.missing, last.host_clock) == (9_000_000 * MS, (COLOR,), "first boot")
    (formed,) = sync.add(elsewhere(COLOR, 50.033, "second boot", epoch=500))
    assert (formed.stamp_ns, formed.missing, formed.host_clock) == (50_033 * MS, (), "second boot")
    assert sync.counters == {"color/color.other_clock": 1}


def test_what_waits_for_a_reference_of_another_clock_is_counted():
    sync = synchroniser()
    sync.add(elsewhere(COLOR, 9_000, "first boot"))
    sync.add(elsewhere(TOF, 50, "second boot"))
    assert sync.add(elsewhere(COLOR, 50, "second boot"))[0].missing == ()
    assert sync.counters == {"color/color.other_clock": 1}


@pytest.mark.parametrize("ahead_s", [-2000, 2000])
def test_the_deadline_needs_no_common_clock(ahead_s):
    sync = synchroniser(deadline_ns=50 * MS)
    sync.add(elsewhere(TOF, 5_000, "other host", received_s=5_000 + ahead_s))
    assert sync.poll((5_000_049 + ahead_s * 1000) * MS) == []
    (formed,) = sync.poll((5_000_050 + ahead_s * 1000) * MS)
    assert formed.missing == (COLOR,)


def test_memory_is_bounded_without_a_reference_and_without_members():
    sync = synchroniser()
    for t_ms in range(1000):
        sync.add(frame(COLOR, t_ms))
    assert sync.counters == {"color/color.overflow": 1000 - DEPTH}
    sync = synchroniser()
    sets = [formed for t_ms in range(0, 33_000, 33) for formed in sync.add(frame(TOF, t_ms))]
    assert len(sets) == 1000 - DEPTH
    assert len(sync.flush()) == DEPTH


def test_a_sensor_whose_clock_is_off_is_paired_by_the_time_that_its_calibration_gives():
    sync = synchroniser(COLOR, offsets_ns={"color": -30 * MS})
    sync.add(frame(COLOR, 130))
    sync.add(frame(COLOR, 100))  # really at 70
    (formed,) = sync.add(frame(TOF, 100))
    assert formed.frames[COLOR].seq == 130
    assert formed.frames[COLOR].t_host_ns == 100 * MS
