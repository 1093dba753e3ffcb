"""Files are read where their disk has bad blocks, or somebody cuts them."""

import errno
import os
import random

import pytest

from abs_service.recording.disk import file_bytes
from abs_service.recording.disk.file_bytes import FileBytes


@pytest.fixture
def opened(tmp_path, monkeypatch):
    """10 kB of a file, of which 1 kB is read at once; the bytes and the path."""
    monkeypatch.setattr(file_bytes, "WINDOW", 1000)
    monkeypatch.setattr(file_bytes, "BLOCK", 64)
    path = tmp_path / "file"
    path.write_bytes(content := random.Random(1).randbytes(10_000))
    with path.open("rb") as stream:
        yield FileBytes(stream.fileno()), content, path


def test_it_has_the_bytes_of_the_file(opened):
    data, content, _ = opened
    assert len(data) == len(content)
    for begin, end in [(0, 8), (990, 1010), (0, 10_000), (9_990, 10_100), (500, 400), (10_000, 10_008), (3, 5)]:
        assert data[begin:end] == content[begin:end]
    start, found = 0, []
    while (start := data.find(b"\x06", start)) >= 0:
        found.append(start)
        start += 1
    assert found == [i for i, byte in enumerate(content) if byte == 6]


def test_a_search_makes_no_copies(opened, monkeypatch):
    """One of the rest of the window for each hit: random bytes have 4096 in a window, and 20 MB took 4 s."""
    data, content, _ = opened
    monkeypatch.setattr(FileBytes, "__getitem__", None)
    assert data.find(content[5000:5001], 5000) == 5000
    assert data.find(b"\x06", 9_000) == content.find(b"\x06", 9_000)


def test_bad_blocks_and_what_was_cut_off_are_zeros(opened, monkeypatch):
    data, content, path = opened
    pread = os.pread

    def read(descriptor, size, position):
        if position < 640 and position + size > 512:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return pread(descriptor, size, position)

    monkeypatch.setattr(os, "pread", read)
    got = data[0:5000]
    assert (got[:448], got[704:]) == (content[:448], content[704:5000])
    assert got[512:640] == bytes(128)
    os.truncate(path, 6000)
    assert data[0:10_000][6000:] == bytes(4000)
