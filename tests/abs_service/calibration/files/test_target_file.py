"""Descriptions of boards: what is written is read back, and every mistake is named with file, key and value."""

from pathlib import Path

import pytest

from abs_service.calibration.files import target_file
from calib.board.target import AsymmetricCircles, Charuco, Chessboard, Circles, Target

CHARUCO = """
kind = "charuco"
columns = 9
rows = 6
square_mm = 30
marker = 0.022
dictionary = "5x5_250"
"""


@pytest.mark.parametrize(
    "target",
    [
        Chessboard(9, 6, 0.025),
        Charuco(14, 9, 0.04, 0.03, "5x5_250"),
        Charuco(9, 6, 0.04, 0.03, "5x5_250", legacy=True),
        Circles(10, 10, 0.0254, 0.0127),
        AsymmetricCircles(4, 11, 0.02, 0.015),
    ],
)
def test_what_is_written_is_read_back(target: Target, tmp_path: Path) -> None:
    path = tmp_path / "target.toml"
    target_file.write(target, path)
    assert "_mm = " in path.read_text(encoding="utf-8")
    read = target_file.read(path)
    assert type(read) is type(target)
    assert getattr(read, "legacy", False) == getattr(target, "legacy", False)
    assert read.points() == pytest.approx(target.points(), abs=1e-9)


def test_lengths_are_metres_or_millimetres(tmp_path: Path) -> None:
    path = tmp_path / "target.toml"
    path.write_text(CHARUCO, encoding="utf-8")
    assert target_file.read(path) == Charuco(9, 6, 0.03, 0.022, "5x5_250")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"charuco"', '"charucko"', ['kind = "charucko"', 'did you mean "charuco"?', "circles"]),
        ('kind = "charuco"', "", ["kind: ", "allowed: april_grid, asymmetric_circles, charuco"]),
        ("columns = 9", "columns = 9.5", ["columns = 9.5", "whole number"]),
        ("columns = 9", "columns = 2", ["columns = 2", "from 3 to 100"]),
        ("columns = 9", "", ["columns: missing"]),
        ("square_mm = 30", "square = 30", ["square = 30", "from 0.0001 to 10 m"]),
        ("square_mm = 30", "square_mm = 3000", ["square_mm = 3000", "27 m long", "0.03 m would make it 0.27 m"]),
        ("square_mm = 30\nmarker = 0.022", "square_mm = 0.3\nmarker = 2.2e-4", ["0.0027 m long", "to 5 m", "0.03 m"]),
        ("square_mm = 30", 'square_mm = "30"', ['square_mm = "30"', "must be a number"]),
        ("square_mm = 30", "square_mm = 30\nsquare = 0.03", ["square = 0.03", "given twice"]),
        ("marker = 0.022", "marker = 0.05", ["marker = 0.05", "less than the square of 0.03 m"]),
        ('"5x5_250"', '"5x5_251"', ['dictionary = "5x5_251"', "4x4_50"]),
        ("columns = 9", "columns = 90", ["dictionary", "250 markers, this board needs 270"]),
        ("rows = 6", "rows = 6\nlegacy = 1", ["legacy = 1", "true or false"]),
        ("rows = 6", "row = 6", ["row = 6", 'did you mean "rows"?']),
        ("rows = 6", "rows = ", ["is not TOML"]),
    ],
)
def test_a_mistake_is_named_with_file_key_and_what_is_allowed(
    tmp_path: Path, old: str, new: str, words: list[str]
) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(CHARUCO.replace(old, new), encoding="utf-8")
    with pytest.raises(target_file.TargetFileError) as caught:
        target_file.read(path)
    for word in ["wrong.toml", *words]:
        assert word in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(target_file.TargetFileError, match=r"none\.toml: cannot be read"):
        target_file.read(tmp_path / "none.toml")
