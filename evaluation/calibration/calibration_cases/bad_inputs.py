"""Bad input never leaves a file that says more than it knows: exit codes, and files that are left."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from abs_service.commands.calibrate.inputs import calibrations
from calib.board.views import CornerView
from evaluation.calibration.calibration_cases.case import Bench, Case, Outcome
from evaluation.experiment import at_least, at_most
from evaluation.scenes.boards import board_views

_BOARD = 'kind = "chessboard"\ncolumns = 9\nrows = 7\nsquare_mm = 40\n'

_HEADS = {"color": board_views.three_heads()["color"]}

#: Exit code of a Python exception that nobody caught, and of none of our commands.
_TRACEBACK = 99


def cases() -> tuple[Case, ...]:
    """Exit codes of ten bad inputs, of a doubtful set and of a good one."""
    return (
        Case("Exit codes: ten inputs that no calibration can come from", "–", refused, brief=False),
        Case("Exit codes: 16 tilted views; 16 views without tilt", "–", judged, brief=False),
    )


def refused(bench: Bench) -> Outcome:
    """Ten inputs, and what each leaves behind."""
    wrong, left, inputs = [], [], _inputs(bench)
    for name, (board, source) in inputs.items():
        (bench.folder / "board.toml").write_text(board, encoding="utf-8")
        said = bench.run("calibrate", "intrinsics", *source, "--target", "board.toml", "--out", "out.toml")
        code = _TRACEBACK if said.count("Traceback") else said.code
        wrong += [f"{name}: {code}"] if code != 2 else []
        left += [f"{name}: {file}" for file in ("out.toml", "out.npz") if bench.exists(file)]
        for file in bench.folder.glob("out.*"):
            file.unlink()
    return Outcome(
        f"{len(inputs) - len(wrong)} of {len(inputs)} end with exit code 2{_list('; others', wrong)}"
        f"{_list('; files left', left)}",
        (
            at_most("other exit codes than 2", len(wrong), 0, required=True),
            at_most("calibrations left", len(left), 0, required=True),
        ),
    )


def _list(title: str, words: Sequence[str]) -> str:
    return f"{title}: {', '.join(words)}" if words else ""


def _inputs(bench: Bench) -> Mapping[str, tuple[str, tuple[str, ...]]]:
    """Description of a board and source, by what is wrong."""
    corners = _views(12, 1.0)
    lost = [replace(view, pixels=np.full_like(view.pixels, np.nan)) for view in corners]
    for name, views in (
        ("good", corners), ("three", corners[:3]), ("none", []), ("lost", lost),
        ("same", [replace(corners[0], shot=k) for k in range(12)]),
    ):  # fmt: skip
        bench.save(name, _HEADS, views)
    content = (bench.folder / "good.corners.npz").read_bytes()
    (bench.folder / "half.corners.npz").write_bytes(content[: len(content) // 2])
    (bench.folder / "text.corners.npz").write_text("no archive", encoding="utf-8")
    return {
        "no such file": (_BOARD, ("absent.corners.npz",)),
        "text instead of corners": (_BOARD, ("text.corners.npz",)),
        "half of a file": (_BOARD, ("half.corners.npz",)),
        "another board": (_BOARD.replace("40", "41"), ("good.corners.npz",)),
        "three views": (_BOARD, ("three.corners.npz",)),
        "no views": (_BOARD, ("none.corners.npz",)),
        "one view twelve times": (_BOARD, ("same.corners.npz",)),
        "corners that are not numbers": (_BOARD, ("lost.corners.npz",)),
        "a description that is no TOML": ("kind = chessboard", ("good.corners.npz",)),
        "a pattern that matches nothing": (_BOARD, ("--images", "color=absent-*.png")),
    }


def judged(bench: Bench) -> Outcome:
    """A good and a doubtful set, and what their files say of themselves."""
    found = []
    bench.board()
    for name, tilt in (("tilted", 1.0), ("flat", 0.0)):
        source = bench.save(name, _HEADS, _views(16, tilt))
        said = bench.run("calibrate", "intrinsics", source, "--target", "board.toml", "--out", f"{name}.toml")
        file = f"{name}.toml"
        found.append((said.code, calibrations.load(bench.folder / file).verdict if bench.exists(file) else "no file"))
    right = found[0] == (0, "good") and found[1] in ((1, "doubtful"), (2, "no file"))
    now = "; ".join(f"exit code {code}, {verdict}" for code, verdict in found)
    return Outcome(now, (at_least("codes and files agree", right, 1, required=True),))


def _views(shots: int, tilt: float) -> list[CornerView]:
    random = np.random.default_rng(8)
    boards = board_views.random_boards(shots, random)
    for T_rb in boards.values():
        T_rb[:3, :3] = T_rb[:3, :3] if tilt else np.eye(3)
    return board_views.look(_HEADS, boards, random).corners
