"""A rig file is read when nobody writes it any more, and one with less in it later than others."""

import os

import pytest

from abs_service.commands.running import settled_file
from abs_service.commands.running.settled_file import Time
from abs_service.wire.commands import RefusedError

WHOLE, HALF = "a = 1\n[b]\n", "a = 1\n"


class World:
    """A file and time, which passes as it is waited for; some texts are written at their times [s]."""

    def __init__(self, path, writes):
        self.path, self.now_s, self.reads = path, 0.0, 0
        self.writes = dict(writes)
        self.write(HALF)

    def sleep(self, seconds):
        self.now_s += seconds
        for moment in [one for one in self.writes if one <= self.now_s]:
            self.write(self.writes.pop(moment))

    def write(self, text):
        self.path.write_text(text)
        os.utime(self.path, (self.now_s, self.now_s))

    def load(self):
        self.reads += 1
        text = self.path.read_text()
        if "?" in text:
            raise ValueError(text)
        return text

    def read(self, age_s=0.0):
        time = Time(lambda: self.now_s, lambda: self.now_s + age_s, self.sleep)
        return settled_file.read(self.path, self.load, lambda text: "[b]" not in text, time)


def test_a_file_that_was_written_long_ago_is_read_at_once(tmp_path):
    world = World(tmp_path / "rig.toml", {})
    assert (world.read(age_s=60.0), world.now_s, world.reads) == (HALF, 0.0, 1)


@pytest.mark.parametrize("writes", [{0.3: WHOLE}, {2.0: WHOLE}, {0.4: "a = 1\n[", 0.8: HALF, 3.0: WHOLE}])
def test_half_of_a_file_that_is_being_written_ends_nothing(tmp_path, writes):
    world = World(tmp_path / "rig.toml", writes)
    assert world.read() == WHOLE
    assert world.now_s <= max(writes) + 0.6


def test_a_file_that_ends_something_is_taken_over_when_it_stays_so(tmp_path):
    world = World(tmp_path / "rig.toml", {})
    assert world.read() == HALF
    assert 3.0 <= world.now_s < 3.2


def test_a_file_that_is_wrong_is_said_to_be(tmp_path):
    with pytest.raises(ValueError, match="a = \\?"):
        World(tmp_path / "rig.toml", {0.1: "a = ?"}).read()


def test_a_file_that_changes_all_the_time_is_refused(tmp_path):
    with pytest.raises(RefusedError, match=r"rig.toml changes all the time; ask again"):
        World(tmp_path / "rig.toml", {number / 4: str(number) for number in range(100)}).read()


def test_another_file_in_its_place_is_a_change(tmp_path):
    world = World(tmp_path / "rig.toml", {})
    (tmp_path / "new").write_text(WHOLE)
    (tmp_path / "new").rename(world.path)
    assert world.read() == WHOLE
