"""Files that are written as a whole: an error leaves what was there."""

import errno
import os

import pytest

from calib.files import atomic


def full(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "another name")


@pytest.mark.parametrize("content", ["“é”\n", b"\x00\xff"])
def test_what_is_written_is_there(tmp_path, content):
    path = tmp_path / "x"
    atomic.write(path, "old")
    atomic.write(path, content)
    assert path.read_bytes() == (content.encode() if isinstance(content, str) else content)
    assert [*tmp_path.iterdir()] == [path]


def test_a_full_disk_leaves_what_was_there_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "x"
    path.write_text("old")
    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="No space left") as raised:
        atomic.write(path, "new")
    assert raised.value.filename == str(path)
    assert path.read_text() == "old"
    assert [*tmp_path.iterdir()] == [path]


def test_a_link_stays_one(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "x").symlink_to("there/y")
    atomic.write(tmp_path / "x", "new")
    assert (tmp_path / "x").is_symlink()
    assert (tmp_path / "there" / "y").read_text() == "new"


def test_a_device_stays_one(tmp_path):
    (tmp_path / "x").symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left"):
        atomic.write(tmp_path / "x", "new")


@pytest.mark.parametrize(("where", "reason"), [("no/x", "No such file"), (".", "Is a directory")])
def test_where_nothing_can_be_written_the_path_is_named(tmp_path, where, reason):
    with pytest.raises(OSError, match=reason) as raised:
        atomic.write(tmp_path / where, "new")
    assert raised.value.filename == str(tmp_path / where)
