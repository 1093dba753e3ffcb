"""Features that users of other tools miss."""

from dataclasses import replace

import cv2
import numpy as np

from abs_service.commands.calibrate.inputs import calibrations
from calib import pose
from calib.board.april_grid import AprilGrid
from calib.board.target import Charuco, Target
from calib.board.views import CornerView
from evaluation.calibration import mrcal_comparison, published_boards
from evaluation.calibration.calibration_cases.case import Bench, Case, Outcome
from evaluation.experiment import UnavailableError, at_least, at_most
from evaluation.scenes.boards import board_views
from evaluation.scenes.boards.board_images import VGA, as_bytes, centered, photograph
from evaluation.scenes.boards.board_views import Head

_BOARDS = {
    "AprilGrid of 6 × 5 tags": AprilGrid(6, 5, 0.03, 0.009),
    "ChArUco of AprilTags 36h11": Charuco(7, 5, 0.036, 0.027, "apriltag_36h11"),
}

#: Tilts of the boards that are rendered, as rotation vectors, and their distances [m].
_POSES = tuple(
    ((tilt * np.cos(angle), tilt * np.sin(angle), 0.1 * k), 0.4 + 0.02 * (k % 4))
    for k, (tilt, angle) in enumerate((0.35 + 0.05 * (k % 3), 2 * np.pi * k / 12) for k in range(12))
)

#: Field of view of the simulated fisheye [°].
_WIDE = 150


def cases() -> tuple[Case, ...]:
    """The paragraph on other tools."""
    missing = "not possible"
    return (
        *(
            Case(
                f"Other tools: {name}, 12 rendered images, error of fx",
                missing,
                lambda bench, b=board: rendered(bench, b),
                brief=False,
            )
            for name, board in _BOARDS.items()
        ),
        Case("Other tools: --fix k3,aspect", missing, fixed),
        Case("Other tools: saved corners, ours and mrcal's, solved without images", missing, saved, brief=False),
        Case(
            f"Other tools: fisheye lenses of {_WIDE}°, stereographic and equisolid",
            "no more than four coefficients",
            wide,
            brief=False,
        ),
        Case("Other tools: mrcal on the same corners (stereo pair, left)", "–", oracle, brief=False),
        Case("Other tools: cross-validation by chosen splits", missing, chosen_halves),
    )


def rendered(bench: Bench, board: Target) -> Outcome:
    """Images from an independent renderer."""
    bench.board(board)
    for number, (rotation, distance) in enumerate(_POSES):
        image = photograph(board, VGA, centered(board, rotation, distance), seed=number)
        cv2.imwrite(str(bench.folder / f"c_{number:02}.png"), as_bytes(image))
    given = ("--images", "color=c_*.png", "--target", "board.toml", "--out", "out.toml")
    said = bench.run("calibrate", "intrinsics", *given)
    camera = calibrations.load(bench.folder / "out.toml").sensors["color"].camera
    error = abs(camera.fx / VGA.fx - 1) * 100
    return Outcome(f"{error:.2f} %; {said.line('fx ')}", (at_most("error of fx", error, 0.5, "%"),))


def fixed(bench: Bench) -> Outcome:
    """Coefficient and ratio that stay as they begin."""
    _save(bench, 12)
    said = bench.run(*_INTRINSICS, "--fix", "k3,aspect")
    camera = calibrations.load(bench.folder / "out.toml").sensors["color"].camera
    moved = max(abs(float(camera.lens.coefficients[4])), abs(camera.fy / camera.fx - 1))
    return Outcome(
        f"k3 = {camera.lens.coefficients[4]:g}, fy / fx = {camera.fy / camera.fx:g}, exit code {said.code}",
        (at_most("moved", moved, 1e-12),),
    )


def saved(bench: Bench) -> Outcome:
    """Corners that were written for mrcal are solved to the same camera."""
    views = _save(bench, 12)
    bench.run(*_INTRINSICS)
    table = ["# filename x y level"]
    points = board_views.board_points()
    for view in views:
        at = {tuple(np.round(point, 6)): pixel for point, pixel in zip(view.points_b, view.pixels, strict=True)}
        for point in points:
            x, y = at.get(tuple(np.round(point, 6)), (None, None))
            table.append(f"color-{view.shot:04d}.png " + ("- - -" if x is None else f"{x:.9f} {y:.9f} 0"))
    (bench.folder / "corners.vnl").write_text("\n".join(table) + "\n", encoding="utf-8")
    given = ("--images", "color=color-*", "--size", "color=1280x720", "--target", "board.toml", "--out", "vnl.toml")
    said = bench.run("calibrate", "intrinsics", "corners.vnl", *given)
    one, other = (calibrations.load(bench.folder / name).sensors["color"].camera for name in ("out.toml", "vnl.toml"))
    return Outcome(
        f"fx {one.fx:.3f} and {other.fx:.3f} px, exit code {said.code}",
        (at_most("difference of fx", abs(one.fx - other.fx), 0.01, "px"),),
    )


def wide(bench: Bench) -> Outcome:
    """The model of a fisheye, fitted to corners of two other projections."""
    known = []
    for name, radius in _PROJECTIONS.items():
        bench.save(name, {"color": _HEAD}, _wide_views(radius))
        given = (f"{name}.corners.npz", "--target", "board.toml", "--lens", "color=fisheye", "--out", f"{name}.toml")
        bench.run("calibrate", "intrinsics", *given)
        residuals = calibrations.load(bench.folder / f"{name}.toml").sensors["color"].residuals
        known.append(residuals.corners_px if residuals.corners_px is not None else np.nan)
    now = ", ".join(f"{name}: corners miss by {each:.3f} px" for name, each in zip(_PROJECTIONS, known, strict=True))
    return Outcome(f"{now} (0.14 px is their noise)", (at_most("corners miss by", max(known), 0.15, "px"),))


def oracle(bench: Bench) -> Outcome:
    """Projections and their uncertainty, where boards were seen."""
    images = bench.real("calib_opencv_stereo")
    if not mrcal_comparison.is_installed():
        raise UnavailableError("needs Debian's python3-mrcal")
    views = [view for view in published_boards.stereo(images) if view.sensor == "left"]
    found = mrcal_comparison.compared(views, (640, 480), published_boards.CHESSBOARD.square)
    own, other, apart = (float(np.median(each)) for each in (found.own, found.other, found.differences))
    return Outcome(
        f"projections differ by {apart:.4f} px (median); known to {own:.3f} px as we say, {other:.3f} px as mrcal says",
        (
            at_most("largest difference over both ±", (found.differences / np.hypot(found.own, found.other)).max(), 3),
            at_least("our ± over mrcal's", own / other, 1),
        ),
    )


def chosen_halves(bench: Bench) -> Outcome:
    """Halves that the user names."""
    _save(bench, 16)
    said = bench.run(*_INTRINSICS, "--half", "0-7")
    return Outcome(
        f"exit code {said.code}: {said.line('halves') or said.line('error')}",
        (at_most("exit code", said.code, 1), at_least("halves are compared", said.count("halves of the shots"), 1)),
    )


_INTRINSICS = ("calibrate", "intrinsics", "views.corners.npz", "--target", "board.toml", "--out", "out.toml")

_COLOR = board_views.three_heads()["color"]
_HEAD = Head(replace(_COLOR.camera, T_rs=np.eye(4)), _COLOR.corner_sigma)

#: Radius over focal length by the angle to the axis.
_PROJECTIONS = {
    "stereographic": lambda angle: 2 * np.tan(angle / 2),
    "equisolid": lambda angle: 2 * np.sin(angle / 2),
}


def _save(bench: Bench, shots: int) -> list[CornerView]:
    random = np.random.default_rng(8)
    views = board_views.look({"color": _HEAD}, board_views.random_boards(shots, random), random).corners
    bench.save("views", {"color": _HEAD}, views)
    return views


def _wide_views(radius) -> list[CornerView]:
    """Corners of boards all around, up to the rim of the field of view."""
    random, views = np.random.default_rng(9), []
    camera = _HEAD.camera
    focal = 0.5 * camera.width / radius(np.radians(_WIDE / 2))
    middle = board_views.board_points().mean(axis=0)
    for shot in range(40):
        aside, around = np.radians(_WIDE / 2) * random.uniform(0, 0.95), random.uniform(0, 2 * np.pi)
        toward = pose.from_rotation_vector((-aside * np.sin(around), aside * np.cos(around), 0), np.zeros(3))
        tilt = pose.from_rotation_vector(tuple(random.uniform(-0.5, 0.5, 3)), np.zeros(3))
        T_sb = toward @ pose.from_rotation_vector((0, 0, 0), (0, 0, random.uniform(0.3, 0.6))) @ tilt
        points = pose.transform(T_sb, board_views.board_points() - middle)
        beside = np.linalg.norm(points[:, :2], axis=1)
        angle = np.arctan2(beside, points[:, 2])
        ends = (focal * radius(angle) / beside)[:, None] * points[:, :2] + (camera.cx, camera.cy)
        inside = (angle < np.radians(_WIDE / 2)) & np.all(
            (ends > 2) & (ends < (camera.width - 3, camera.height - 3)), 1
        )
        if inside.sum() >= 12:
            pixels = ends[inside] + random.normal(0, _HEAD.corner_sigma, (int(inside.sum()), 2))
            views.append(CornerView("color", shot, float(shot), board_views.board_points()[inside], pixels, 0.1))
    return views
