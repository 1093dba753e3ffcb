"""Times of exposures in lists and names are understood in the units that other programs write."""

from pathlib import Path

import pytest

from drivers.image_folder import times
from drivers.image_folder.listing import ImageFolderError, are_timed, by_list, by_name, by_number


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1305031102.160407123", 1305031102_160407123),
        ("1305031102", 1305031102_000000000),
        ("0.033", 33_000_000),
        ("1305031102160", 1305031102_160000000),
        ("1305031102160.407123", 1305031102_160407123),
        ("1305031102160407", 1305031102_160407000),
        ("1305031102160407123", 1305031102_160407123),
        ("1305031102160407123.9", 1305031102_160407123),
        ("130503110216", None),
        ("-1.0", None),
        ("soon", None),
    ],
)
def test_a_time_has_the_unit_that_its_digits_tell(text: str, expected: int | None) -> None:
    assert times.nanoseconds(text) == expected


@pytest.mark.parametrize(
    ("stem", "expected"),
    [
        ("1305031102.160407", 1305031102_160407000),
        ("1305031102_160407000", 1305031102_160407000),
        ("rs_Depth_1612345678901.25000000", 1612345678_901250000),
        ("depth_1305031102160407", 1305031102_160407000),
        ("1305031102160407123", 1305031102_160407123),
        ("0.033333", 33_333_000),
        ("depth_000200", None),
        ("img1000200", None),
        ("frame-000001.depth", None),
        ("take1.0001", None),
        ("1.2", None),
        ("depth_20240131134501", None),
        ("d_2018-10-05__10-30-50", None),
        ("", None),
    ],
)
def test_a_name_has_a_time_where_a_count_would_not_look_like_it(stem: str, expected: int | None) -> None:
    assert times.in_name(stem) == expected


def test_images_are_in_the_order_of_the_times_in_their_names(tmp_path: Path) -> None:
    for name in ("1305031103.001.png", "1305031102.995.png", "1305031102.961.png"):
        (tmp_path / name).touch()
    files = by_name(tmp_path, "*.png", 30.0)
    assert [(file.seq, file.t_ns) for file in files] == [
        (0, 1305031102_961000000),
        (1, 1305031102_995000000),
        (2, 1305031103_001000000),
    ]
    assert are_timed(files)


def test_names_that_do_not_all_have_times_are_numbers(tmp_path: Path) -> None:
    for name in ("1305031102160.png", "1305031103.png"):
        (tmp_path / name).touch()
    files = by_name(tmp_path, "13050311*.png", 1e6)
    assert [file.seq for file in files] == [1305031103, 1305031102160]
    assert not are_timed(files)
    with pytest.raises(ImageFolderError, match=r"1305031102160\.png: 1305031102160 is too large for the number"):
        by_name(tmp_path, "*.png", 30.0)
    assert by_number(tmp_path, "*.png", 30.0)[-1].seq == 1305031102160, "boards are paired by such numbers"


def test_two_images_of_one_time_are_named(tmp_path: Path) -> None:
    for name in ("a_1305031102.160.png", "b_1305031102.160.png"):
        (tmp_path / name).touch()
    with pytest.raises(ImageFolderError, match=r"b_1305031102\.160\.png: has the same time as a_1305031102\.160\.png"):
        by_name(tmp_path, "*.png", 30.0)


def test_a_list_may_have_nanoseconds(tmp_path: Path) -> None:
    (tmp_path / "0.png").touch()
    (tmp_path / "depth.txt").write_text("1305031102160407123 0.png\n")
    assert by_list(tmp_path, "depth.txt")[0].t_ns == 1305031102_160407123
    (tmp_path / "depth.txt").write_text("130503110216 0.png\n")
    with pytest.raises(ImageFolderError, match=r"line 1 must be .* 13, 16 or 19 digits before the point, in ms, µs or"):
        by_list(tmp_path, "depth.txt")


def test_a_film_is_told_from_images(tmp_path: Path) -> None:
    (tmp_path / "color.mp4").touch()
    with pytest.raises(ImageFolderError, match=r"color\.mp4: is a film; `ffmpeg -i color\.mp4 .*` makes images of it"):
        by_name(tmp_path, "color.mp4", 30.0)
