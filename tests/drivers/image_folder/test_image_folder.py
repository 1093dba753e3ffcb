"""Image files are read unchanged in order of time; errors name the file."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.camera import Camera
from drivers.contract.frame import Geometry, Kind
from drivers.image_folder import image_file
from drivers.image_folder.images import ColorImages, DepthImages, ImageFolder
from drivers.image_folder.listing import ImageFile, ImageFolderError, by_list, by_number, time_problem

CAMERA = Camera(4, 3, 4.0, 4.0, 1.5, 1.0)


def save(path: Path, image: np.ndarray) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), image)
    return path


def depth_image(value: int = 1000) -> np.ndarray:
    return np.full((3, 4), value, np.uint16) + np.arange(4, dtype=np.uint16)


def test_numbers_in_names_are_sequence_numbers(tmp_path: Path) -> None:
    for name in ("d2_10.png", "d2_9.png", "d2_12.png", "other_3.png"):
        save(tmp_path / name, depth_image())
    files = by_number(tmp_path, "d2_*.png", rate_hz=10.0)
    assert [(file.path.name, file.seq, file.t_ns) for file in files] == [
        ("d2_9.png", 9, 900_000_000),
        ("d2_10.png", 10, 1_000_000_000),
        ("d2_12.png", 12, 1_200_000_000),
    ]


def test_lists_name_images_and_their_times_exactly(tmp_path: Path) -> None:
    for name in ("b.png", "a.png"):
        save(tmp_path / "depth" / name, depth_image())
    (tmp_path / "depth.txt").write_text(
        "# depth maps\n1305031102.194330 depth/b.png\n\n1305031102.160407123 depth/a.png  # first\n"
    )
    files = by_list(tmp_path, "depth.txt")
    assert [(file.path.name, file.seq, file.t_ns) for file in files] == [
        ("a.png", 0, 1305031102_160407123),
        ("b.png", 1, 1305031102_194330000),
    ]


def test_times_that_go_back_from_line_to_line_are_told(tmp_path: Path) -> None:
    for k in range(4):
        save(tmp_path / f"{k}.png", depth_image())
    (tmp_path / "good.txt").write_text("".join(f"{k / 30} {k}.png\n" for k in range(4)))
    (tmp_path / "bad.txt").write_text("0.015 0.png\n0.014 1.png\n0.016 2.png\n0.016 3.png\n")
    assert time_problem(tmp_path, "good.txt") == ""
    assert time_problem(tmp_path, "bad.txt").startswith(
        "the times of 2 of 4 lines are not later than those of the line"
    )
    assert time_problem(tmp_path, "bad.txt").endswith("within 0.002 s")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (None, "depth.txt: cannot be read: No such file"),
        ("# nothing\n", "depth.txt: names no image"),
        ("1.0 depth/a.png\nsoon depth/a.png\n", "depth.txt: line 2 must be a time and a path, not 'soon depth/a.png'"),
        ("1.0\n", "depth.txt: line 1 must be a time and a path"),
        ("1.0 depth/z.png\n", "depth.txt: line 1: there is no file .*z.png"),
    ],
)
def test_errors_in_lists_name_the_line(tmp_path: Path, text: str | None, complaint: str) -> None:
    save(tmp_path / "depth" / "a.png", depth_image())
    if text is not None:
        (tmp_path / "depth.txt").write_text(text)
    with pytest.raises(ImageFolderError, match=complaint):
        by_list(tmp_path, "depth.txt")


def test_times_in_names_are_an_order_where_no_other_images_are_matched(tmp_path: Path) -> None:
    for name in ("d_2018-10-05__10-30-50.png", "d_2018-10-05__9-31-50.png", "d_2018-10-05__10-29-50.png"):
        save(tmp_path / name, depth_image())
    files = by_number(tmp_path, "d_*.png", 10.0, alone=True)
    assert [(file.path.name[14:-4], file.seq, file.t_ns) for file in files] == [
        ("9-31-50", 0, 0),
        ("10-29-50", 1, 100_000_000),
        ("10-30-50", 2, 200_000_000),
    ]
    with pytest.raises(ImageFolderError, match=r"tells which images belong together: let it count the exposures"):
        by_number(tmp_path, "d_*.png", 10.0)
    save(tmp_path / "d_2018-10-05__10-30-050.png", depth_image())
    with pytest.raises(ImageFolderError, match=r"10-30-50\.png: has the same number as d_2018-10-05__10-30-050\.png"):
        by_number(tmp_path, "d_*.png", 10.0, alone=True)


@pytest.mark.parametrize(
    ("names", "complaint"),
    [
        ([], "no file matches 'depth_\\*.png'"),
        (
            ["depth_left.png", "depth_1.png"],
            r"depth_left.png: there is no number in its name .*; images there match .*'depth_left.png' \(1\)",
        ),
        (["depth_1.png", "depth_01.png"], "depth_1.png: has the same number as depth_01.png"),
    ],
)
def test_errors_in_names_name_the_file(tmp_path: Path, names: list[str], complaint: str) -> None:
    for name in names:
        save(tmp_path / name, depth_image())
    with pytest.raises(ImageFolderError, match=complaint):
        by_number(tmp_path, "depth_*.png", 30.0)


def test_where_no_name_matches_the_patterns_of_the_images_that_are_there_are_named(tmp_path: Path) -> None:
    for name in ("color/00000.jpg", "color/00001.jpg", "depth/00000.png", "frame-7.depth.png", "readme.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    with pytest.raises(ImageFolderError) as caught:
        by_number(tmp_path, "depth_*.png", 30.0)
    named = "images there match 'color/*.jpg' (2), 'depth/*.png' (1), 'frame-*.depth.png' (1)"
    assert str(caught.value) == f"{tmp_path}: no file matches 'depth_*.png'; {named}"
    assert [file.seq for file in by_number(tmp_path, "color/*.jpg", 30.0)] == [0, 1], "what is named matches"


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "depth.mat").write_bytes(b"")
    with pytest.raises(ImageFolderError, match=r"depth\.mat: is no folder"):
        by_number(tmp_path / "depth.mat", "*.png", 30.0)


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(ImageFolderError, match="nowhere: no such folder"):
        by_number(tmp_path / "nowhere", "*.png", 30.0)


def test_depth_is_read_unchanged(tmp_path: Path) -> None:
    file = ImageFile(save(tmp_path / "d_7.png", depth_image()), 7, 70)
    frame = DepthImages([file], CAMERA, 0.001, Geometry.RADIAL, invalid=1003).frame(file)
    assert (frame.kind, frame.encoding, frame.geometry, frame.seq, frame.t_host_ns) == (
        Kind.DEPTH,
        "16UC1",
        Geometry.RADIAL,
        7,
        70,
    )
    np.testing.assert_allclose(frame.si()[0], [1.0, 1.001, 1.002, np.nan])
    assert frame.calib_id == CAMERA.calib_id


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_masked_depth_is_invalid(tmp_path: Path, channels: int) -> None:
    mask = np.zeros((3, 4) if channels == 1 else (3, 4, channels), np.uint8)
    if channels == 4:
        mask[..., :3] = 200  # what is transparent counts as black, whatever its colour
    mask[1, 2] = 255
    path = save(tmp_path / "m_7.png", mask)
    file = ImageFile(save(tmp_path / "d_7.png", depth_image()), 7, 0)
    frame = DepthImages([file], CAMERA, 0.001, masks={7: path}).frame(file)
    assert np.count_nonzero(np.isfinite(frame.si())) == 1
    assert frame.data[1, 2] == 1002
    assert frame.filters == ("mask",)


def test_colour_is_red_green_blue(tmp_path: Path) -> None:
    bgr = np.zeros((3, 4, 3), np.uint8)
    bgr[..., 0], bgr[..., 2] = 10, 200
    bgra = np.dstack([bgr, np.full((3, 4), 9, np.uint8)])
    gray = np.full((3, 4), 77, np.uint8)
    for image, expected in ((bgr, (200, 0, 10)), (bgra, (200, 0, 10)), (gray, (77, 77, 77))):
        file = ImageFile(save(tmp_path / "c_0.png", image), 0, 0)
        frame = ColorImages([file], CAMERA).frame(file)
        assert tuple(frame.data[2, 3]) == expected
        assert frame.encoding == "rgb8"


def test_frames_come_in_the_order_of_their_times(tmp_path: Path) -> None:
    depth = [ImageFile(save(tmp_path / f"d_{k}.png", depth_image()), k, 100 * k) for k in range(3)]
    color = [ImageFile(save(tmp_path / f"c_{k}.png", depth_image().astype(np.uint8)), k, 80 * k) for k in range(3)]
    frames = ImageFolder({"depth": DepthImages(depth, CAMERA, 0.001), "color": ColorImages(color, CAMERA)}).frames()
    assert [(frame.sensor, frame.t_host_ns) for frame in frames] == [
        ("depth", 0),
        ("color", 0),
        ("color", 80),
        ("depth", 100),
        ("color", 160),
        ("depth", 200),
    ]


@pytest.mark.parametrize(
    ("image", "complaint"),
    [
        (
            depth_image().astype(np.uint8),
            r"d_0.png: depth must have one channel .*, this is 1 × 8 bit; images of 8 bits are for looking at",
        ),
        (
            np.dstack([depth_image()] * 3),
            r"d_0.png: depth must have one channel of 16 bits or of floating-point numbers, this is 3 × 16 bit",
        ),
        (np.zeros((4, 4), np.uint16), r"d_0.png: the image has 4 × 4 pixels, its camera 4 × 3"),
    ],
)
def test_other_depth_formats_are_rejected(tmp_path: Path, image: np.ndarray, complaint: str) -> None:
    file = ImageFile(save(tmp_path / "d_0.png", image), 0, 0)
    with pytest.raises(ImageFolderError, match=complaint):
        DepthImages([file], CAMERA, 0.001).frame(file)


def test_16_bit_colour_and_other_files_are_rejected(tmp_path: Path) -> None:
    file = ImageFile(save(tmp_path / "c_0.png", np.dstack([depth_image()] * 3)), 0, 0)
    with pytest.raises(ImageFolderError, match=r"c_0.png: colour must have 8 bits per channel, this is 3 × 16 bit"):
        ColorImages([file], CAMERA).frame(file)
    file.path.write_bytes(b"no image")
    with pytest.raises(ImageFolderError, match=r"c_0.png: cannot be read as an image"):
        ColorImages([file], CAMERA).frame(file)


def test_a_pointer_of_git_lfs_is_said_to_be_one(tmp_path: Path) -> None:
    pointer = tmp_path / "c_0.png"
    pointer.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n", encoding="utf-8")
    with pytest.raises(ImageFolderError, match=r"c_0\.png: is a pointer of Git LFS.*git lfs pull"):
        image_file.read(pointer)


@pytest.mark.parametrize("name", image_file.READABLE.replace(" and", ",").split(", "))
def test_each_format_that_is_said_to_be_readable_is(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"image.{name.lower()}"
    image = np.zeros((3, 4, 1 if name == "PGM" else 3), np.uint8)
    if name == "NPY":
        np.save(path, image[..., 0])
    else:
        assert cv2.imwrite(str(path), image)
    assert image_file.read(path).shape[:2] == (3, 4)
