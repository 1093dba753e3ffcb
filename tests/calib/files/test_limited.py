import io
import os
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest

from calib.files import limited


def test_a_file_of_the_largest_size_is_read_and_a_larger_one_refused(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(b"12345")
    assert limited.read(tmp_path / "x", 5) == b"12345"
    with pytest.raises(OSError, match="it is larger than 4 bytes"):
        limited.read(tmp_path / "x", 4)


def test_what_has_no_size_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(OSError, match="no regular file"):
            limited.read(path, 1 << 20)


def test_a_byte_order_mark_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("name = 1", encoding="utf-8-sig")
    assert limited.text(tmp_path / "x") == "name = 1"


def test_arrays_come_back(tmp_path: Path) -> None:
    np.savez(tmp_path / "x.npz", a=np.arange(3.0))
    assert limited.arrays(tmp_path / "x.npz")["a"].tolist() == [0.0, 1.0, 2.0]


def test_arrays_that_are_too_large_are_refused_before_they_are_unpacked() -> None:
    stream = io.BytesIO()
    with ZipFile(stream, "w", ZIP_DEFLATED) as file, file.open("a.npy", "w", force_zip64=True) as part:
        for _ in range(limited.MAX_ARRAYS_BYTES // (1 << 24) + 1):
            part.write(bytes(1 << 24))
    assert len(stream.getvalue()) < 1 << 20
    with pytest.raises(ValueError, match="are allowed"):
        limited.unpacked(stream.getvalue())


def test_an_array_that_claims_more_than_there_is_memory_is_damaged() -> None:
    header, stream = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (1 << 50,)})
    with ZipFile(stream, "w") as file:
        file.writestr("a.npy", header.getvalue())
    with pytest.raises(ValueError, match="damaged"):
        limited.unpacked(stream.getvalue())
