"""Parts of a rig that another configuration concerns."""

import pytest

from abs_service import config
from abs_service.config import changes

TWO = """
version = 1
name = "pair"

[devices.one]
uri = "simulated://sheet?seed=1"

[devices.two]
uri = "simulated://sheet?seed=2"

[sensors.tof]
device = "one"
noise = { type = "gaussian_polynomial", sigma = [[0.002]] }

[sensors.other]
device = "two"
head = "tof"
noise = { type = "gaussian_polynomial", sigma = [[0.002]] }

[synchronisation]
reference = "tof/depth"

[trackers.left]
sensors = ["tof"]
model = { type = "nurbs", control_points = [4, 4] }

[trackers.right]
sensors = ["other"]
reference = "other/depth"
model = { type = "nurbs", control_points = [4, 4] }

[record]
directory = "takes"
"""


def between(tmp_path, *replaced):
    text = TWO
    for old, new in replaced:
        assert old in text
        text = text.replace(old, new, 1)
    return changes.between(*(config.loads(toml, "x.toml", tmp_path) for toml in (TWO, text)))


def test_nothing_starts_again_for_the_same(tmp_path):
    assert between(tmp_path) == changes.Changes((), ())


@pytest.mark.parametrize(
    ("old", "new", "components"),
    [
        ("control_points = [4, 4]", "control_points = [5, 4]", ("track/left", "record", "view")),
        ('reference = "other/depth"', 'reference = "other/depth"\nbudget_ms = 9.0', ("track/right", "record", "view")),
        ("[[0.002]] }\n\n[sensors.o", "[[0.003]] }\n\n[sensors.o", ("track/left", "record", "view")),
        ("seed=2", "seed=3", ("capture", "track/right", "record", "view")),
        ('head = "tof"', 'head = "tof"\nview_hz = 2.0', ("capture", "track/right", "record", "view")),
        ('head = "tof"', 'head = "tof"\ntime_offset_ms = 2.0', ("track/right", "record", "view")),
        (
            'reference = "tof/depth"',
            'reference = "tof/depth"\ntolerance_ms = 3.0',
            ("track/left", "track/right", "record"),
        ),
        ('directory = "takes"', 'directory = "others"', ("record",)),
    ],
)
def test_only_what_is_concerned_starts_again(tmp_path, old, new, components):
    assert between(tmp_path, (old, new)) == changes.Changes((), components)


def test_a_tracker_is_added_and_removed_without_the_other_one(tmp_path):
    found = between(tmp_path, ("[trackers.right]", "[trackers.centre]"))
    assert found == changes.Changes((), ("track/centre", "record", "view"), ("track/right",))


@pytest.mark.parametrize(
    ("old", "new", "fixed"),
    [
        ('name = "pair"', 'name = "couple"', "name"),
        ("[record]", '[bus]\nendpoint = "tcp/127.0.0.1:7999"\n\n[record]', "bus"),
        ("[record]", "[run]\nmax_restarts = 9\n\n[record]", "run"),
        ("[record]", "[record]\nenabled = false", "record.enabled"),
    ],
)
def test_what_a_running_rig_stands_on_cannot_change(tmp_path, old, new, fixed):
    # Beside a change that would be possible: all or nothing.
    assert between(tmp_path, (old, new), ("seed=2", "seed=3")) == changes.Changes((fixed,), ())
