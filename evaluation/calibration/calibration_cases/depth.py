"""Distances that are too long: what `verify` names, and what `rig` finds."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from abs_service.commands.calibrate.inputs import calibrations
from calib import pose
from calib.board.target import Chessboard
from calib.camera import Camera
from evaluation.calibration.calibration_cases.case import Bench, Case, Outcome, Said
from evaluation.experiment import at_least, at_most
from evaluation.scenes.boards.board_views import Head, Seen, look, random_boards, three_heads

#: Share by which the simulated distances are too long.
_SCALE = 0.01

#: Camera of its real images, and of the distances that are aligned to them.
_REALSENSE = Camera(848, 480, 617.0289198, 617.010437011, 422.6674499, 248.56015)


def cases() -> tuple[Case, ...]:
    """Silent failures 5 and 6."""
    moved = '"one has moved, 3.0 mm and 0.72°"'
    return (
        Case("5 verify: aligned depth 1 % long, boards 0.6 to 1.6 m away", moved, long_distances, brief=False),
        Case("5 verify: aligned depth 1 % long, boards 0.95 to 1.05 m away", moved, long_at_one_distance),
        Case("5 verify: boards elsewhere by 6 mm in each image of the second camera", "one has moved", unsynchronised),
        Case("5 verify: real aligned depth, 0.6 to 1.4 % long", moved, real_distances),
        Case("6 rig: aligned depth 1 % long, --fixed-pose", "no such option", fixed_pose, brief=False),
        Case(
            "6 rig: aligned depth 1 % long, its pose free, boards 0.95 to 1.05 m away",
            "real: −2.7 ± 0.7 % for +0.6 to +1.4 %, and 24 mm of translation; nothing said",
            free_pose,
        ),
    )


def long_distances(bench: Bench) -> Outcome:
    """Boards at many distances."""
    return _verified(bench, 0.6, 1.6)


def long_at_one_distance(bench: Bench) -> Outcome:
    """Boards at one distance, where a scale looks like an offset."""
    found = _verified(bench, 0.95, 1.05)
    reported = "cannot tell" in (bench.folder / "said.txt").read_text(encoding="utf-8")
    return replace(found, goals=(*found.goals, at_least("says what cannot be distinguished", reported, 1)))


def _verified(bench: Bench, near: float, far: float) -> Outcome:
    heads, seen = _aligned(near, far)
    source = bench.save("views", heads, seen.corners, seen.planes)
    stored = bench.store("lab", heads)
    said = bench.run("calibrate", "verify", stored, source, "--target", "board.toml")
    causes = [one for one in bench.values("lab-verify.json")["explanations"] if "scale" in one["kind"]]
    error = min((abs(one["values"][0] - _SCALE) for one in causes), default=np.nan)
    found = _named(bench, said)
    return replace(found, goals=(*found.goals, at_most("error of the scale", error * 100, 0.3, "%")))


def _named(bench: Bench, said: Said) -> Outcome:
    """The cause that a verification names: distances, and no motion."""
    (bench.folder / "said.txt").write_text(said.text, encoding="utf-8")
    return Outcome(
        f"exit code {said.code}: {said.line('measures distances wrongly')}",
        (
            at_least("exit code", said.code, 1),
            at_least("distances named first", said.count("depth: measures distances wrongly"), 1),
            at_most("a motion claimed", said.count("no longer stand") + said.count("one of color, depth has moved"), 0),
        ),
    )


def unsynchronised(bench: Bench) -> Outcome:
    """A board in a hand, seen by two cameras one after the other."""
    heads = {name: head for name, head in three_heads().items() if name != "tof"}
    random = np.random.default_rng(3)
    boards = random_boards(10, random)
    later = {
        shot: pose.from_rotation_vector((0, 0, 0), random.normal(0, 0.006, 3)) @ T_rb for shot, T_rb in boards.items()
    }
    corners = [
        *look({"light": heads["light"]}, boards, random).corners,
        *look({"color": heads["color"]}, later, random).corners,
    ]
    source = bench.save("views", heads, corners)
    said = bench.run("calibrate", "verify", bench.store("lab", heads), source, "--target", "board.toml")
    return Outcome(
        f"exit code {said.code}: {said.line('same moment')}",
        (
            at_least("exit code", said.code, 1),
            at_least("cause named", said.count("were not taken at the same moment"), 1),
            at_most("a motion claimed", said.count("has moved"), 0),
        ),
    )


def real_distances(bench: Bench) -> Outcome:
    """Five views of a RealSense, as in `tests/abs_service/calibration/cameras/test_aligned_depth.py`."""
    images = bench.real("realsense_checkerboard")
    keys = "\n".join(f"{key} = {getattr(_REALSENSE, key)}" for key in ("width", "height", "fx", "fy", "cx", "cy"))
    (bench.folder / "camera.toml").write_text(f"[depth]\n{keys}\n[color]\n{keys}\n", encoding="utf-8")
    layout = ("--layout", "pairs", "--camera", "camera.toml", "--rate", "1")
    bench.run("import", images, *layout, "--out", "take.mcap")
    bench.board(Chessboard(9, 6, 0.02315))
    stored = bench.store("lab", {name: Head(_REALSENSE) for name in ("depth", "color")})
    return _named(bench, bench.run("calibrate", "verify", stored, "take.mcap", "--target", "board.toml"))


def fixed_pose(bench: Bench) -> Outcome:
    """The pose is known, so the scale is found."""
    said = _solved(bench, 0.6, 1.6, "--fixed-pose", "depth")
    found = calibrations.load(bench.folder / "out.toml")
    scale, sigma = found.sensors["depth"].depth_scale, found.covariance.of("depth")["depth_scale"]
    return Outcome(
        f"exit code {said.code}: {scale:+.2%} ± {sigma:.2%}",
        (
            at_most("error of the scale", abs(scale - _SCALE) * 100, 0.2, "%"),
            at_most("error over its ±", abs(scale - _SCALE) / sigma, 3),
        ),
    )


def free_pose(bench: Bench) -> Outcome:
    """The pose is free, and looks like the scale."""
    said = _solved(bench, 0.95, 1.05)
    found = calibrations.load(bench.folder / "out.toml")
    depth, sigma = found.sensors["depth"], found.covariance.of("depth")
    moved = 1e3 * float(np.linalg.norm(depth.camera.T_rs[:3, 3] - found.sensors["color"].camera.T_rs[:3, 3]))
    return Outcome(
        f"exit code {said.code}: {depth.depth_scale:+.2%} ± {sigma['depth_scale']:.2%}, moved by {moved:.1f} mm; "
        f"{said.line('held by the shots')}",
        (
            at_least("exit code", said.code, 1),
            at_least("the direction is named", said.count("depth: the scale of its distances"), 1),
            at_most("error over its ±", abs(depth.depth_scale - _SCALE) / sigma["depth_scale"], 3),
        ),
    )


def _solved(bench: Bench, near: float, far: float, *options: str):
    heads, seen = _aligned(near, far)
    source = bench.save("views", heads, seen.corners, seen.planes)
    stored = bench.store("lab", heads)
    common = ("--target", "board.toml", "--start", stored, "--keep", "color", "--reference", "color")
    terms = ("--depth-terms", "depth=scale", "--out", "out.toml")
    return bench.run("calibrate", "rig", source, *common, *terms, *options)


def _aligned(near: float, far: float) -> tuple[Mapping[str, Head], Seen]:
    """A colour camera and a depth image aligned to it, as stored, and ten shots with distances that are too long."""
    color = three_heads()["color"]
    color = replace(color, camera=replace(color.camera, T_rs=np.eye(4)))
    heads = {"color": color, "depth": Head(color.camera, depth_sigma=0.02)}
    random = np.random.default_rng(5)
    now = {**heads, "depth": replace(heads["depth"], depth_scale=_SCALE)}
    return heads, look(now, random_boards(10, random, near, far), random)
