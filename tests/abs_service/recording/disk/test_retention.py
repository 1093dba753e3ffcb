"""Retention deletes the oldest recordings of a folder, and some files never."""

import math
import os
from functools import partial

import pytest

from abs_service.recording.disk.retention import Ages, Retention
from abs_service.recording.recording_file import ESTIMATES

DAY_NS = 86_400_000_000_000
NOW_NS = 1_800_000_000_000_000_000


def put(folder, name, age_days=0.0, size=100):
    """A file of the folder whose last change was so long ago."""
    path = folder / name
    path.write_bytes(bytes(size))
    mtime_ns = NOW_NS - int(age_days * DAY_NS)
    os.utime(path, ns=(mtime_ns, mtime_ns))
    return path


def take(day):
    return f"demo_2026-11-{day:02}T10-00-00Z.mcap"


def apply(retention):
    """The files that it deletes in a process that has just started."""
    ages = Ages(lambda t_ns: NOW_NS + t_ns, retention.retain_s, lambda: True)
    deleted, failures = retention.apply(partial(ages.of, now_ns=0))
    assert failures == []
    return deleted


def names(paths):
    return [path.name for path in paths]


@pytest.fixture
def week(tmp_path):
    """Recordings that are 7, 6, … 1 days old, of 100 bytes each."""
    for day in range(1, 8):
        put(tmp_path, take(day), 8 - day)
    return tmp_path


def test_what_is_too_old_is_deleted(week):
    retention = Retention(week, "demo", "", retain_s=4.5 * 86_400, retain_bytes=math.inf)
    assert names(apply(retention)) == [take(1), take(2), take(3)]
    assert apply(retention) == []
    assert len(list(week.iterdir())) == 4


def test_what_a_clock_of_1970_recorded_is_not_as_old_as_that(week):
    put(week, "demo_1970-01-01T00-00-09Z.mcap", NOW_NS / DAY_NS)
    assert names(apply(Retention(week, "demo", "", retain_s=5.5 * 86_400, retain_bytes=math.inf))) == [take(1), take(2)]


def test_the_oldest_are_deleted_until_the_others_fit(week):
    assert names(apply(Retention(week, "demo", "", math.inf, 350))) == [take(day) for day in (1, 2, 3, 4)]


def test_a_link_that_leads_nowhere_keeps_nothing_from_being_deleted(week):
    loop, gone = week / take(20), week / take(21)
    loop.symlink_to(loop)
    gone.symlink_to(week / "gone")
    assert names(apply(Retention(week, "demo", "", math.inf, 350))) == [take(day) for day in (1, 2, 3, 4)]


def test_nothing_is_deleted_unless_it_was_asked_for(week):
    assert apply(Retention(week, "demo", "", math.inf, math.inf)) == []


def test_what_is_marked_is_kept_and_does_not_count(week):
    (week / (take(1) + ".keep")).touch()
    assert names(apply(Retention(week, "demo", "", math.inf, 500))) == [take(2)]
    assert (week / take(1)).exists()


@pytest.mark.parametrize(
    "name",
    [
        "demo_2026-11-01T10-00-00Z.mcap.active",  # perhaps written at this moment
        "demo_2_2026-11-01T10-00-00Z.mcap",  # of another rig
        "demo_2026-11-01T10-00-00Z.mp4",
        "demo_2026-11-01T10-00-00Z_estimates.mcap",
        "take.mcap",
        "demo.mcap",
    ],
)
def test_what_is_no_finished_recording_of_this_rig_stays(week, name):
    put(week, name, age_days=100)
    apply(Retention(week, "demo", "", 0.5, 0))
    assert names(week.iterdir()) == [name]


def test_the_unfinished_file_counts(week):
    put(week, take(8) + ".active", size=400)
    assert len(apply(Retention(week, "demo", "", math.inf, 700))) == 4


def test_what_recoveries_left_goes_with_the_recordings(tmp_path):
    left = [f"demo_2026-11-01T10-00-00Z{end}" for end in ("_2.mcap", ".mcap.broken", ".recovered.mcap")]
    for name in left:
        put(tmp_path, name, age_days=2)
    assert sorted(names(apply(Retention(tmp_path, "demo", "", 86_400, math.inf)))) == sorted(left)


def test_files_of_estimates_are_kept_as_long_as_their_own_limits_say(week):
    left = [
        f"demo_2026-11-01T10-00-00Z{end}"
        for end in ("_estimates.mcap", "_2_estimates.mcap", "_estimates.recovered.mcap")
    ]
    for name in left:
        put(week, name, age_days=9)
    assert sorted(names(apply(Retention(week, "demo", ESTIMATES, 86_400, math.inf)))) == sorted(left)
    assert len(list(week.iterdir())) == 7


def test_a_folder_that_is_gone_holds_nothing(tmp_path):
    assert apply(Retention(tmp_path / "gone", "demo", "", 1.0, 1.0)) == []
