"""Demands on the verdict: which shots, why, how far apart, and what the images lack."""

import re
import shutil
from pathlib import Path

import cv2
import numpy as np

from calib.board.target import Chessboard
from evaluation.calibration import published_boards
from evaluation.calibration.calibration_cases.case import Bench, Case, Outcome, Said
from evaluation.calibration.simulated_board import scene
from evaluation.experiment import at_least, at_most

#: Shots of OpenCV's stereo pair.
_SHOTS = (1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14)

#: Distance of its cameras as `cv2.stereoCalibrate` finds it [mm].
_BASELINE_MM = 82.9


def cases() -> tuple[Case, ...]:
    """The paragraph on the verdict."""
    return (
        Case(
            "Verdict, rig: right images of shots 4 and 9 exchanged (stereo pair)",
            "no shot named",
            swapped,
            brief=False,
        ),
        Case(
            "Verdict, rig: each right image with the next left one",
            "no figure on the terminal, no report",
            shifted,
            brief=False,
        ),
        Case(
            "Verdict, rig: distance and angle, to check with a ruler (stereo pair)",
            "not on the terminal",
            ruler,
            brief=False,
        ),
        Case("Verdict, compare: published and own calibration, where the board never was", "–", two_tools, brief=False),
        Case(
            "Verdict: another board than described (9 × 6 inner corners)",
            "`--sensor : boards were seen by several, allowed: none`",
            no_board,
        ),
        Case("Verdict: stills imported as 30 images per second", '"the board moved"', stills),
        Case("Verdict: a truncated image", "its grey part was searched", truncated),
        Case(
            "Verdict: empty tables in the page of a rig without depth",
            "empty tables, others cut off",
            empty_tables,
            brief=False,
        ),
    )


def swapped(bench: Bench) -> Outcome:
    """Two shots whose right images are exchanged."""
    said = _stereo(bench, {4: 9, 9: 4})
    now = f"exit code {said.code}: {said.line('belongs to')[:300]}"
    named = said.count("shot 4:", "shot 9:", "--skip 4,9")
    return Outcome(now, (at_least("exit code", said.code, 1), at_least("both named, and --skip", named, 3)))


def shifted(bench: Bench) -> Outcome:
    """Pairs of which all are wrong, which end in an error."""
    said = _stereo(bench, {shot: _SHOTS[(k + 1) % len(_SHOTS)] for k, shot in enumerate(_SHOTS)})
    reason = said.line("same moment") or said.line("agree on") or said.line("error")
    return Outcome(
        f"exit code {said.code}: {reason[:400]}",
        (
            at_least("exit code", said.code, 1),
            at_least("a report", bench.exists("out.html"), 1),
            at_least("a figure on the terminal", re.search(r"\d px", reason) is not None, 1),
            at_most("calibrations written after an error", said.code == 2 and bench.exists("out.toml"), 0),
        ),
    )


def ruler(bench: Bench) -> Outcome:
    """The stereo pair as it is."""
    line = (said := _stereo(bench, {})).line("mm apart")
    found = re.search(r"([\d.]+) mm apart, turned by ([\d.]+)°", line)
    error = abs(float(found[1]) / _BASELINE_MM - 1) if found else np.nan
    return Outcome(f"exit code {said.code}: {line}", (at_most("error of the distance", error * 100, 1, "%"),))


def two_tools(bench: Bench) -> Outcome:
    """The left camera, by OpenCV and by us."""
    images = bench.real("calib_opencv_stereo")
    bench.board(published_boards.CHESSBOARD)
    given = ("--images", f"left={images}/left[0-9]*.jpg", "--target", "board.toml", "--out", "out.toml")
    bench.run("calibrate", "intrinsics", *given)
    said = bench.run("calibrate", "compare", "out.toml", images / "left_intrinsics.yml", "--corners", "out.corners.npz")
    places = said.count("where boards were seen: median", "elsewhere: median", "at column", "more than by chance in")
    now = "; ".join(said.line(word) for word in ("where boards were seen", "elsewhere"))
    return Outcome(now, (at_least("both places, where, and chance", places, 4),))


def no_board(bench: Bench) -> Outcome:
    """A board of 10 × 7 inner corners is described."""
    images = bench.real("calib_opencv_stereo")
    bench.board(Chessboard(10, 7, 0.025))
    given = ("--images", f"left={images}/left0[1-4].jpg", "--target", "board.toml", "--out", "out.toml")
    said = bench.run("calibrate", "intrinsics", *given)
    said_of = said.count("no board of 10 × 7 inner corners in any of 4 images", "show a board of 9 × 6 inner corners")
    return Outcome(
        f"exit code {said.code}: {said.line('no board of')}", (at_least("what, and what instead", said_of, 2),)
    )


def stills(bench: Bench) -> Outcome:
    """Stills of a simulated board with the times of a film."""
    board = scene("chessboard", "sensors=color", "rate=2", "seed=5", "color=320x240", "hold=0.1")
    bench.board(board.target)
    camera = board.simulation.heads["color"].camera
    for k in range(6):
        (frame,) = board.simulation.frames(4 * k)
        cv2.imwrite(str(bench.folder / f"color_{k}.png"), np.ascontiguousarray(frame.data[..., ::-1], np.uint8))
        cv2.imwrite(str(bench.folder / f"depth_{k}.png"), np.zeros((240, 320), np.uint16))
    keys = "\n".join(f"{key} = {getattr(camera, key)}" for key in ("width", "height", "fx", "fy", "cx", "cy"))
    (bench.folder / "camera.toml").write_text(f"[depth]\n{keys}\n[color]\n{keys}\n", encoding="utf-8")
    bench.run("import", bench.folder, "--layout", "pairs", "--camera", "camera.toml", "--out", "take.mcap")
    given = ("take.mcap", "--target", "board.toml", "--every", "0", "--out", "out.toml")
    said = bench.run("calibrate", "intrinsics", *given)
    return Outcome(
        f"exit code {said.code}: {said.line('--rate 1')}", (at_least("--rate 1 is named", said.count("--rate 1"), 1),)
    )


def truncated(bench: Bench) -> Outcome:
    """A PNG that ends early."""
    bench.board()
    file = bench.folder / "c_1.png"
    cv2.imwrite(str(file), np.random.default_rng(0).integers(0, 255, (120, 160), np.uint8))
    file.write_bytes(file.read_bytes()[:-2000])
    given = ("--images", "color=c_*.png", "--target", "board.toml", "--out", "out.toml")
    said = bench.run("calibrate", "intrinsics", *given)
    named = said.count("c_1.png: the image is truncated")
    return Outcome(f"exit code {said.code}: {said.line('truncated')}", (at_least("the file is named", named, 1),))


def empty_tables(bench: Bench) -> Outcome:
    """Rows in the tables of a report."""
    _stereo(bench, {})
    page = (bench.folder / "out.html").read_text(encoding="utf-8")
    tables = re.findall(r"<tbody>(.*?)</tbody>", page, re.DOTALL)
    empty = sum("<tr" not in body for body in tables)
    return Outcome(f"{empty} of {len(tables)}", (at_least("tables", len(tables), 1), at_most("empty tables", empty, 0)))


def _stereo(bench: Bench, right_of: dict[int, int]) -> Said:
    """Exit of `calibrate rig` of the stereo pair; some shots have the right image of another one."""
    images: Path = bench.real("calib_opencv_stereo")
    bench.board(published_boards.CHESSBOARD)
    for shot in _SHOTS:
        shutil.copy(images / f"left{shot:02}.jpg", bench.folder / f"left{shot:02}.jpg")
        shutil.copy(images / f"right{right_of.get(shot, shot):02}.jpg", bench.folder / f"right{shot:02}.jpg")
    given = ("--images", "left=left*.jpg", "--images", "right=right*.jpg", "--target", "board.toml")
    return bench.run("calibrate", "rig", *given, "--out", "out.toml")
