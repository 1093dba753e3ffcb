"""Recovery saves every sound message of a damaged file and counts the others."""

import fcntl
import os
import random
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.capture.mcap_writing import write_frame
from abs_service.recording.disk import file_bytes
from abs_service.recording.recovery import RecoveryError, leftovers, recover, remove_interrupted
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.encoding.mcap_file import Compression, McapFile

HEADER = HeaderFactory("demo", WallClock(), "boot").at(0, 0)
CHUNK_HEAD = 9 + 32 + len("lz4") + 8  # bytes of a chunk record before its compressed data
FRAMES = 40


def write(path, finish=True, compression=Compression.LZ4):
    """Forty noisy frames in chunks of about four, which no compression makes much smaller."""
    pixels = np.random.default_rng(1)
    with path.open("wb") as stream:
        file = McapFile(stream, compression, chunk_size=8000)
        file.attach("rig.toml", "text/toml", b"version = 1\n", 5)
        for seq in range(FRAMES):
            data = pixels.integers(0, 65535, (24, 32), np.uint16)
            item = Frame("tof", "depth", Kind.DEPTH, data, "16UC1", seq, seq, seq, geometry=Geometry.Z)
            write_frame(file, item, HEADER, seq + 1)
        file.flush()
        if finish:
            file.finish()
    return path


def read(path):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        decoded = [(m.channel.topic, m.message.sequence, m.message.data) for m in reader.iter_decoded_messages()]
        return decoded, [a.name for a in reader.iter_attachments()]


def chunk_spans(path):
    """Position of the compressed data of each chunk."""
    data = path.read_bytes()
    with path.open("rb") as stream:
        chunks = [r for r in StreamReader(stream, emit_chunks=True).records if isinstance(r, Chunk)]
    return [(data.index(chunk.data), len(chunk.data)) for chunk in chunks]


@pytest.mark.parametrize("compression", Compression)
def test_a_file_that_was_only_not_finished_is_saved_completely_and_replaced(tmp_path, compression):
    expected = read(write(tmp_path / "whole.mcap", compression=compression))
    source = write(tmp_path / "a.mcap.active", finish=False, compression=compression)
    report = recover(source)
    assert (report.messages, report.damaged, report.orphans, report.skipped_bytes) == (2 * FRAMES, 0, 0, 0)
    assert report.target == tmp_path / "a.mcap"
    assert read(report.target) == expected
    assert report.source is None
    assert not source.exists()
    assert str(report).endswith("nothing lost")


def test_a_torn_end_costs_only_the_torn_chunk_and_the_original_is_kept(tmp_path):
    source = write(tmp_path / "a.mcap.active", finish=False)
    start, length = chunk_spans(write(tmp_path / "whole.mcap"))[-1]
    whole = source.read_bytes()
    source.write_bytes(whole[: start + length // 2])
    report = recover(source)
    assert 2 * FRAMES - 10 <= report.messages < 2 * FRAMES
    assert report.source == tmp_path / "a.mcap.broken"
    assert (tmp_path / "a.mcap.broken").read_bytes() == whole[: start + length // 2]
    sequences = [seq for topic, seq, _ in read(report.target)[0] if topic == "/tof/depth/image"]
    assert sequences == list(range(len(sequences)))


@pytest.mark.parametrize("finish", [True, False])
@pytest.mark.parametrize("number", [0, 3, -1])
def test_a_flipped_bit_costs_only_its_chunk_even_if_that_one_names_the_channels(tmp_path, number, finish):
    expected = read(write(tmp_path / "whole.mcap"))[0]
    start, length = chunk_spans(tmp_path / "whole.mcap")[number]
    source = write(tmp_path / "a.mcap", finish=finish)
    data = bytearray(source.read_bytes())
    data[start + length // 2] ^= 4
    source.write_bytes(data)
    report = recover(source)
    assert (report.damaged, report.orphans, report.skipped_bytes) == (1, 0, 0)
    saved = read(report.target)
    assert saved[1] == ["rig.toml"]
    assert set(saved[0]) < set(expected)
    assert len(expected) - 12 <= len(saved[0]) == report.messages
    assert report.target == tmp_path / "a.recovered.mcap"
    assert source.read_bytes() == data, "a file that somebody names is left as it is"
    assert "1 damaged chunks" in str(report)


@pytest.mark.parametrize("byte", range(CHUNK_HEAD))
def test_a_damaged_head_of_a_chunk_costs_only_that_chunk(tmp_path, byte):
    expected = read(write(tmp_path / "whole.mcap"))[0]
    start, _ = chunk_spans(tmp_path / "whole.mcap")[4]
    source = write(tmp_path / "a.mcap", finish=False)
    data = bytearray(source.read_bytes())
    data[start - CHUNK_HEAD + byte] ^= 0xFF
    source.write_bytes(data)
    report = recover(source)
    saved = read(report.target)[0]
    assert report.damaged + report.skipped_bytes > 0 or len(saved) == len(expected)
    assert len(expected) - 12 <= len(saved)
    assert set(saved) <= set(expected)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = write(tmp_path_factory.mktemp("whole") / "whole.mcap", finish=False)
    return path.read_bytes(), frozenset(read(recover(path).target)[0])


@settings(max_examples=60, deadline=None)
@given(
    flips=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(1, 255)), max_size=4),
    keep=st.floats(0.2, 1.0),
    zeros=st.integers(0, 5000),
)
def test_any_damage_yields_a_readable_file_without_invented_messages(whole, tmp_path_factory, flips, keep, zeros):
    data, expected = bytearray(whole[0]), whole[1]
    for place, mask in flips:
        data[8 + int(place * (len(data) - 8))] ^= mask
    source = tmp_path_factory.mktemp("damaged") / "a.mcap.active"
    source.write_bytes(bytes(data[: int(keep * len(data))]) + bytes(zeros))
    report = recover(source)
    saved = read(report.target)[0]
    assert len(saved) == report.messages
    assert set(saved) <= expected
    # A flip costs its chunk; where it hits a length, the search may run to the next chunk.
    assert len(saved) >= 2 * FRAMES * keep - 12 * (len(flips) * 2 + 1) - 12


def test_random_bytes_are_no_recording(tmp_path):
    source = tmp_path / "a.mcap"
    source.write_bytes(random.Random(1).randbytes(100_000))
    with pytest.raises(RecoveryError, match="holds no MCAP record"):
        recover(source)
    source.write_bytes(b"")
    with pytest.raises(RecoveryError, match="the file is empty"):
        recover(source)
    with pytest.raises(RecoveryError, match="No such file"):
        recover(tmp_path / "b.mcap")


def test_a_file_that_is_being_written_is_not_recovered(tmp_path):
    source = write(tmp_path / "a.mcap.active", finish=False)
    with source.open("rb") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        with pytest.raises(RecoveryError, match="another process"):
            recover(source)
    assert list(leftovers(tmp_path)) == [source]


def test_a_bad_block_of_the_disk_costs_its_chunk_and_ends_nothing(tmp_path, monkeypatch):
    source = write(tmp_path / "a.mcap.active", finish=False)
    bad, pread = source.stat().st_size // 2, os.pread

    def read(descriptor, size, position):
        if position <= bad < position + size:
            raise OSError(5, "Input/output error")
        return pread(descriptor, size, position)

    monkeypatch.setattr(os, "pread", read)
    monkeypatch.setattr(file_bytes, "BLOCK", 16)
    report = recover(source)
    assert report.source == tmp_path / "a.mcap.broken"
    assert 0 < report.messages < 2 * FRAMES
    assert report.damaged + report.skipped_bytes


def test_what_cannot_be_looked_at_is_no_leftover(tmp_path):
    (tmp_path / "a.mcap.active").symlink_to(tmp_path / "gone")
    source = write(tmp_path / "b.mcap.active", finish=False)
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "c.mcap.active").mkdir()
    os.mkfifo(tmp_path / "d.mcap.active")
    assert list(leftovers(tmp_path)) == [source]
    assert not leftovers(tmp_path / "loop")
    remove_interrupted(tmp_path / "loop")


def test_an_interrupted_recovery_is_repeated(tmp_path, monkeypatch):
    source = write(tmp_path / "a.mcap.active", finish=False)
    monkeypatch.setattr("os.fsync", lambda _: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(OSError, match="No space left"):
        recover(source)
    monkeypatch.undo()
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap.active"]
    assert recover(source).messages == 2 * FRAMES


def test_a_power_cut_at_any_moment_leaves_no_second_copy(tmp_path, monkeypatch):
    for calls in (1, 2):
        source, left = write(tmp_path / f"{calls}.mcap.active", finish=False), [calls]
        for name in ("replace", "unlink"):
            monkeypatch.setattr(os, name, cut_after(left, getattr(os, name)))
        with suppress(KeyboardInterrupt):
            recover(source)
        monkeypatch.undo()
        if calls == 1:
            recover(source)
        assert [path.name for path in tmp_path.iterdir()] == [f"{calls}.mcap"]
        assert len(read(tmp_path / f"{calls}.mcap")[0]) == 2 * FRAMES
        (tmp_path / f"{calls}.mcap").unlink()


def cut_after(left, function):
    """The function, after which all ends as soon as it has been called so often."""

    def called(*arguments, **options):
        function(*arguments, **options)
        left[0] -= 1
        if not left[0]:
            raise KeyboardInterrupt

    return called


def test_what_a_killed_recovery_left_is_removed_and_what_a_living_one_writes_is_not(tmp_path):
    (tmp_path / "dead.mcap.recovering").touch()
    os.mkfifo(tmp_path / "pipe.mcap.recovering")  # nor is it waited for one
    with (tmp_path / "alive.mcap.recovering").open("wb") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        remove_interrupted(tmp_path)
        assert sorted(path.name[:4] for path in tmp_path.iterdir()) == ["aliv", "pipe"]


def test_a_pipe_is_refused_instead_of_waited_for(tmp_path):
    os.mkfifo(path := tmp_path / "x.mcap.active")
    with pytest.raises(RecoveryError, match="no regular file"):
        recover(path)
