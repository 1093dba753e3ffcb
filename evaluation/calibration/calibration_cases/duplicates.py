"""Views that are given twice: they count once."""

import shutil
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.board.views import CornerView
from evaluation.calibration import published_boards
from evaluation.calibration.calibration_cases.case import Bench, Case, Outcome
from evaluation.experiment import at_least, at_most
from evaluation.scenes.boards import board_views
from evaluation.scenes.boards.bent import bent

_SIGMA_PX = 0.1

#: Copies have these numbers added to those of their shots.
_COPIES = 100


def cases() -> tuple[Case, ...]:
    """Silent failure 1 of the commands that take views or sequences."""
    return (
        Case(
            "1 intrinsics: real images that are not trusted, each file twice (circle grid)",
            '18 others: "do not trust" (halves differ by 0.42 px, 0.13 predicted); twice: "Trust it" (1.7e-14 px)',
            circles_twice,
            brief=False,
        ),
        Case(
            "1 intrinsics: 18 views of a bent board, each twice with new noise of 0.1 px",
            '"Trust it"',
            bent_twice,
        ),
        Case("1 rig: six poses, each held for three shots", "as files given twice", held_still, brief=False),
        Case("1 intrinsics: four poses, each twice", "passed the minimum of six views", four_twice),
        Case(
            "1 verify: ten poses, each five times: σ of a motion, repeated / once",
            "–",
            verified_five_times,
            brief=False,
        ),
        Case("1 noise: one recording given three times", "three sequences, held out from each other", noise_thrice),
    )


def circles_twice(bench: Bench) -> Outcome:
    """The images of the circle grid, once and twice."""
    images = bench.real("calib_rct_circles") / "images"
    board = bench.board(published_boards.CIRCLES)
    for path in images.glob("*.png"):
        for copy in (0, _COPIES):
            shutil.copy(path, bench.folder / f"c{copy}_{int(path.stem) + copy}.png")
    once, twice = (
        bench.run("calibrate", "intrinsics", "--images", f"cam={pattern}", "--target", board, "--out", f"{name}.toml")
        for name, pattern in (("once", "c0_*.png"), ("twice", "c*.png"))
    )
    halves = [bench.values(f"{name}.json")["halves"]["cam"] for name in ("once", "twice")]
    figures = "; ".join(f"{each['difference_px']:.2g} px, {each['predicted_px']:.2g} predicted" for each in halves)
    return Outcome(
        f"exit codes {once.code} and {twice.code}; halves differ by {figures}",
        (
            at_least("exit code", twice.code, 1, required=True),
            at_least("difference twice / once", halves[1]["difference_px"] / halves[0]["difference_px"], 0.8),
        ),
    )


def bent_twice(bench: Bench) -> Outcome:
    """Simulated views of a board that is bent in each view."""
    said = _intrinsics(bench, _repeated(_bent_views(18), 2))
    halves = bench.values("out.json")["halves"]["color"]
    now = f"exit code {said.code}; {halves['difference_px']:.2g} px, {halves['predicted_px']:.2g} predicted"
    return Outcome(now, (at_least("exit code", said.code, 1, required=True),))


def held_still(bench: Bench) -> Outcome:
    """A rig of two cameras, before which a board is held still."""
    heads = {name: head for name, head in board_views.three_heads().items() if name != "tof"}
    random = np.random.default_rng(3)
    boards = board_views.random_boards(6, random)
    seen = board_views.look(heads, {3 * shot + k: T_rb for shot, T_rb in boards.items() for k in range(3)}, random)
    source = bench.save("still", heads, seen.corners)
    said = bench.run("calibrate", "rig", source, "--target", "board.toml", "--out", "out.toml")
    return Outcome(
        f"exit code {said.code}; {said.line('distinct poses')}",
        (at_least("exit code", said.code, 1), at_least("poses are counted", said.count("6 distinct poses"), 1)),
    )


def four_twice(bench: Bench) -> Outcome:
    """Too few distinct poses."""
    said = _intrinsics(bench, _repeated(_bent_views(4), 2))
    return Outcome(
        f"exit code {said.code}; {said.line('distinct poses')}",
        (at_least("exit code", said.code, 2, required=True), at_most("files written", bench.exists("out.toml"), 0)),
    )


def verified_five_times(bench: Bench) -> Outcome:
    """Shots that repeat a pose do not make a verification surer."""
    heads = {name: head for name, head in board_views.three_heads().items() if name != "tof"}
    random = np.random.default_rng(1)
    corners = board_views.look(heads, board_views.random_boards(10, random), random).corners
    bench.store("lab", heads)
    sigmas = []
    for times in (1, 5):
        again = [replace(view, shot=times * view.shot + k) for view in corners for k in range(times)]
        source = bench.save("views", heads, again)
        bench.run("calibrate", "verify", "lab.toml", source, "--target", "board.toml")
        sigmas.append(bench.values("lab-verify.json")["pairs"][0]["sigma_px"])
    ratio = sigmas[1] / sigmas[0]
    return Outcome(f"{ratio:.3f}", (at_least("σ repeated / once", ratio, 0.97, required=True),))


def noise_thrice(bench: Bench) -> Outcome:
    """One recording, three times."""
    source = "simulated://wall?sensors=tof&tof=32x24&rate=200"
    said = bench.run("calibrate", "noise", source, source, source, "--frames", 12, "--out", "noise")
    page = (bench.folder / "noise.html").read_text(encoding="utf-8")
    counted = "count as one sequence" in said.text + page
    return Outcome(
        f"exit code {said.code}; {'counted as one sequence' if counted else 'counted as three'}",
        (at_least("counted once", counted, 1, required=True), at_least("exit code", said.code, 1)),
    )


def _intrinsics(bench: Bench, corners: Sequence[CornerView]):
    heads = {"color": board_views.three_heads()["color"]}
    source = bench.save("views", heads, corners)
    return bench.run("calibrate", "intrinsics", source, "--target", "board.toml", "--out", "out.toml")


def _bent_views(shots: int) -> list[CornerView]:
    """Corners without noise that err together in each view, as on a board that is bent by hand."""
    generator = np.random.default_rng(2)
    camera = replace(board_views.three_heads()["color"].camera, T_rs=np.eye(4))
    head = board_views.Head(camera, 1e-9)
    seen = board_views.look({"color": head}, board_views.random_boards(shots, generator), generator)
    return [replace(bent(view, 1.0, generator), sigma_px=_SIGMA_PX) for view in seen.corners]


def _repeated(seen: Sequence[CornerView], times: int) -> list[CornerView]:
    """Each view again, with new noise."""
    generator = np.random.default_rng(4)
    return [
        replace(
            view, shot=times * view.shot + k, pixels=view.pixels + generator.normal(0, _SIGMA_PX, view.pixels.shape)
        )
        for view in seen
        for k in range(times)
    ]
