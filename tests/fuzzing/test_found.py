"""Findings of `test_files`, each as the shortest file that shows it."""

import struct
from pathlib import Path

import pytest

from calib.formats import opencv
from calib.formats.content import FormatError, Hints
from drivers.contract.device import DeviceError
from drivers.replay.contents import scan
from tests.fuzzing.test_files import recording

ATTACHMENT = 9


def with_attachment(tmp_path: Path, offset: int, value: int) -> Path:
    """A recording with eight bytes overwritten, counted from the beginning of its attachment."""
    data = bytearray(recording())
    begin = data.index(b"rig.toml") - 4 - 16 - 9  # after the length of the name, two times and the record's own length
    assert data[begin] == ATTACHMENT
    data[begin + offset : begin + offset + 8] = struct.pack("<Q", value)
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    return path


#: The length of the record, and that of the data in it, after name and media type.
LENGTHS = (1, 9 + 16 + 4 + len("rig.toml") + 4 + len("text/toml"))


@pytest.mark.parametrize("offset", LENGTHS)
@pytest.mark.parametrize("value", [1 << 40, 1 << 59, (1 << 64) - 1])
def test_a_recording_whose_attachment_claims_to_be_huge_is_refused_by_name(
    tmp_path: Path, offset: int, value: int
) -> None:
    path = with_attachment(tmp_path, offset, value)
    with pytest.raises(DeviceError, match=r"x\.mcap: an attachment is damaged .*recover"):
        scan(path)


def test_a_matrix_whose_data_do_not_fit_is_refused() -> None:
    text = "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 1., 0. ]\n"
    with pytest.raises(FormatError, match="do not fit"):
        opencv.read(text, Hints())
