"""Printed boards: true to scale by what the file itself says, and found again by our own detector in a scan of it."""

import json
import re
import zlib
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from abs_service import cli
from abs_service.calibration.files import target_file
from abs_service.supervision.exit_codes import Exit
from calib.board.corners.detection import detect
from calib.board.target import outline

KINDS = ["charuco", "chessboard", "circles", "asymmetric_circles", "april_grid"]
POINT_MM = 25.4 / 72
SVG = "{http://www.w3.org/2000/svg}"
#: Pixels per millimetre of a scan.
DENSITY = 5

Polygon = NDArray[np.float64]


def svg_shapes(path: Path) -> tuple[tuple[float, float], list[Polygon]]:
    """Size of the paper and black shapes, in mm from the upper left corner, by what the file says."""
    root = ElementTree.parse(path).getroot()
    size = tuple(float(root.attrib[key].removesuffix("mm")) for key in ("width", "height"))
    assert root.attrib["viewBox"].split() == ["0", "0", *(f"{length:g}" for length in size)]
    shapes = []
    (group,) = [group for group in root.iter(f"{SVG}g") if group.attrib.get("fill") == "black"]
    for part in group:
        n = {key: float(value) for key, value in part.attrib.items()}
        if part.tag == f"{SVG}rect":
            x, y, w, h = n["x"], n["y"], n["width"], n["height"]
            shapes.append(np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]]))
        else:
            angle = np.linspace(0, 2 * np.pi, 90, endpoint=False)
            shapes.append(np.stack([n["cx"] + n["r"] * np.cos(angle), n["cy"] + n["r"] * np.sin(angle)], axis=1))
    return (size[0], size[1]), shapes


def pdf_shapes(path: Path) -> tuple[tuple[float, float], list[Polygon]]:
    """The same of a PDF: the filled paths of its page. Curves are cut into chords."""
    data = path.read_bytes()
    box = re.search(rb"/MediaBox \[ ([\d. ]+) \]", data)
    assert box is not None
    _, _, width, height = (float(number) * POINT_MM for number in box[1].split())
    streams = [zlib.decompress(s) for s in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", data, re.S) if s[:1] == b"x"]
    content = max((stream for stream in streams if b" m\n" in stream), key=len).decode("latin-1")
    shapes, path_points = [], []
    for line in content.splitlines():
        *numbers, operator = line.split() or [""]
        if operator == "m":
            path_points = [np.array(numbers, float)]
        elif operator == "l":
            path_points.append(np.array(numbers, float))
        elif operator == "c":
            a, (b, c, d) = path_points[-1], np.array(numbers, float).reshape(3, 2)
            t = np.linspace(0.1, 1, 10)[:, None]
            path_points += list((1 - t) ** 3 * a + 3 * t * (1 - t) ** 2 * b + 3 * t**2 * (1 - t) * c + t**3 * d)
        elif operator in {"f", "f*"} and len(path_points) > 2:
            points = np.array(path_points) * POINT_MM
            shapes.append(np.stack([points[:, 0], height - points[:, 1]], axis=1))
    return (width, height), shapes


def scan(size: tuple[float, float], shapes: list[Polygon]) -> NDArray[np.uint8]:
    """The page as a scanner sees it; the centre of its first pixel is half a pixel inside the paper."""
    fine = 4
    shape = [round(length * DENSITY) * fine for length in reversed(size)]
    image = np.full(shape, 230, np.uint8)
    for polygon in shapes:
        corners = np.rint((polygon * DENSITY * fine - 0.5) * 256).astype(np.int32)
        cv2.fillPoly(image, [corners], 20, shift=8)
    return cv2.resize(image, None, fx=1 / fine, fy=1 / fine, interpolation=cv2.INTER_AREA).astype(np.uint8)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ending", ["svg", "pdf"])
def test_a_scan_of_the_page_shows_the_board_true_to_scale(tmp_path: Path, kind: str, ending: str) -> None:
    out = tmp_path / f"board.{ending}"
    assert cli.main(["calibrate", "target", kind, "--out", str(out)]) == Exit.OK
    target = target_file.read(tmp_path / "board.toml")
    size, shapes = (svg_shapes if ending == "svg" else pdf_shapes)(out)
    assert sorted(size) == pytest.approx([210, 297], abs=0.01)
    found = detect(target, scan(size, shapes))
    assert len(found.ids) == len(target.points())
    measured, true = found.pixels / DENSITY, target.points()[found.ids, :2] * 1e3
    offset = measured.mean(axis=0) - true.mean(axis=0)
    assert np.abs(measured - true - offset).max() < 0.05


@pytest.mark.parametrize("ending", ["svg", "pdf"])
def test_shapes_are_where_they_belong_to_five_hundredths_of_a_millimetre(tmp_path: Path, ending: str) -> None:
    out = tmp_path / f"board.{ending}"
    cli.main(
        ["calibrate", "target", "chessboard", "--columns", "9", "--rows", "6", "--square-mm", "25.4", "--out", str(out)]
    )
    _, shapes = (svg_shapes if ending == "svg" else pdf_shapes)(out)
    squares = [polygon for polygon in shapes if len(polygon) >= 4 and np.ptp(polygon, axis=0).min() > 5]
    assert len(squares) == 35
    for square in squares:
        assert np.ptp(square, axis=0) == pytest.approx((25.4, 25.4), abs=0.01)
    corners = np.concatenate(squares)
    assert np.ptp(corners, axis=0) == pytest.approx((10 * 25.4, 7 * 25.4), abs=0.02)


def test_the_ruler_is_as_long_as_it_says(tmp_path: Path) -> None:
    cli.main(["calibrate", "target", "--out", str(tmp_path / "t.svg")])
    root = ElementTree.parse(tmp_path / "t.svg").getroot()
    line = next(root.iter(f"{SVG}line")).attrib
    assert float(line["x2"]) - float(line["x1"]) == pytest.approx(100, abs=1e-3)
    assert "the line is 100 mm long" in "".join(root.itertext())


def test_the_paper_is_turned_so_that_the_board_fits_and_may_be_of_any_size(tmp_path: Path) -> None:
    arguments = ["chessboard", "--columns", "5", "--rows", "8", "--paper", "a3", "--out", str(tmp_path / "t.svg")]
    cli.main(["calibrate", "target", *arguments])
    assert svg_shapes(tmp_path / "t.svg")[0] == (297, 420)
    cli.main(["calibrate", "target", "--paper", "500x400", "--out", str(tmp_path / "big.svg")])
    assert svg_shapes(tmp_path / "big.svg")[0] == (500, 400)


def test_programs_learn_what_was_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "t.svg"
    cli.main(["calibrate", "target", "--square-mm", "20", "--out", str(out), "--json"])
    written = json.loads(capsys.readouterr().out)
    assert written["page"] == str(out)
    assert (written["target"]["square_mm"], written["target"]["marker_mm"]) == (20.0, 15.0)
    assert target_file.read(Path(written["description"])) == target_file.read(tmp_path / "t.toml")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["charuco", "--square-mm", "40"], ["360 × 240 mm", "74 % of what they are"]),
        (["circles", "--square-mm", "40"], ["--square-mm = 40.0", "means nothing for circles"]),
        (["charuco", "--marker-mm", "30"], ["--marker-mm", "less than the square"]),
        (["charuco", "--columns", "2"], ["--columns", "from 3 to 100"]),
        (["charuco", "--dictionary", "9x9"], ["--dictionary", "5x5_100"]),
        (["charuco", "--out", "no/x.pdf"], ["--out no/x.pdf: there is no folder no"]),
    ],
)
def test_what_cannot_be_printed_is_said(
    arguments: list[str], words: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["calibrate", "target", *arguments]) == Exit.USER
    message = capsys.readouterr().err
    for word in words:
        assert word in message
    assert list(tmp_path.iterdir()) == []


def test_a_page_has_a_format_that_can_be_printed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        cli.main(["calibrate", "target", "--out", "t.png"])
    assert "argument --out: t.png: its suffix must be one of .pdf, .svg" in capsys.readouterr().err


def test_the_board_of_the_page_is_where_its_outline_says() -> None:
    corners = outline(target_file.from_table({"kind": "chessboard", "columns": 3, "rows": 4, "square_mm": 10}, "x"))
    assert corners[:, :2].tolist() == [[-0.01, -0.01], [0.03, -0.01], [0.03, 0.04], [-0.01, 0.04]]


def test_a_description_with_measured_lengths_is_not_replaced(tmp_path, capsys):
    command = ["calibrate", "target", "--out", str(tmp_path / "t.svg")]
    assert cli.main(command) == cli.main(command) == Exit.OK
    description = tmp_path / "t.toml"
    measured = description.read_text().replace("square_mm = 28.0", "square_mm = 27.9")
    description.write_text(measured)
    assert cli.main(command) == Exit.USER
    assert (
        f"{description}: exists and says something else; remove it, or choose another --out" in capsys.readouterr().err
    )
    assert description.read_text() == measured
