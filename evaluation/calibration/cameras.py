"""Joint calibration of cameras on published boards and on simulated rigs: tables of docs/explanation/calibration.md.

Statistic: number of rigs whose true parameters lie inside their joint 95 % region; root mean square error of a coarse
camera's pose by corners over that by corners and planes. Published boards are reported without a goal.
Goals: as many inside as a binomial distribution of 95 % has in 99.5 % of the cases; at least a factor of 2.
Seeds: of the rigs, 0, 1, …; the context's is not used.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from abs_service.report.content import Cell, Column, Section, Table
from calib import pose
from calib.board.views import CornerView
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.solve.bundle.parameters.lens_parameters import BROWN_CONRADY, RATIONAL, LensKind
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation.verdict import assess
from evaluation.calibration import published_boards, simulated_rig
from evaluation.experiment import Context, Findings, Goal, at_least, at_most

TITLE = "Camera calibration: published boards, coverage and planes on simulated rigs"

#: Folders of the published boards.
FOLDERS = ("calib_rct_circles", "calib_opencv_stereo", "calib_azure_charuco")


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        rigs: simulated rigs whose coverage is counted.
        plane_rigs: simulated rigs with a coarse time-of-flight camera.
        corner_sigmas: standard deviations of its corners [px]; the goal is about 0.6.
    """

    rigs: int = simulated_rig.SEEDS
    plane_rigs: int = simulated_rig.PLANE_SEEDS
    corner_sigmas: tuple[float, ...] = (0.3, simulated_rig.COARSE_PX, 1.0)


QUICK = Settings(1, 1, (simulated_rig.COARSE_PX,))


def run(settings: Settings, context: Context) -> Findings:
    """Calibrates the published boards in the data folder, and the simulated rigs."""
    sections = []
    if context.data is not None and all((context.data / name).is_dir() for name in FOLDERS):
        context.progress("published boards")
        sections.append(_published(context.data))
    inside = _coverage(settings, context)
    planes = {}
    for sigma in settings.corner_sigmas:
        context.progress(f"planes, corners to {sigma:g} px")
        errors = [simulated_rig.tof_errors(seed, sigma) for seed in range(settings.plane_rigs)]
        planes[sigma] = np.array(errors).T * 1e3
    sections += [_coverage_section(inside, settings.rigs), _planes_section(planes)]
    goals = (*_coverage_goals(inside, settings.rigs), _planes_goal(planes))
    values = {"inside": inside, "tof_error_mm": {f"{sigma:g}": errors for sigma, errors in planes.items()}}
    return Findings(goals, tuple(sections), values)


def _coverage(settings: Settings, context: Context) -> dict[str, int]:
    """Number of the simulated rigs whose truth lies in the 95 % region, by group of parameters."""
    found = []
    for seed in range(settings.rigs):
        context.progress(f"rig {seed + 1} of {settings.rigs}")
        found.append(simulated_rig.error_probabilities(seed))
    return {name: sum(each[name] < 0.95 for each in found) for name in found[0]}


def _coverage_goals(inside: Mapping[str, int], rigs: int) -> tuple[Goal, ...]:
    """The lowest and highest count lie in the central 99.5 % of the binomial distribution."""
    low, high = stats.binom.interval(0.995, rigs, 0.95)
    return (
        at_least(f"Of {rigs} rigs those with the truth in the 95 % region, the fewest", min(inside.values()), low),
        at_most(f"Of {rigs} rigs those with the truth in the 95 % region, the most", max(inside.values()), high),
    )


def _planes_goal(planes: Mapping[float, NDArray[np.float64]]) -> Goal:
    corners, both = planes.get(simulated_rig.COARSE_PX, next(iter(planes.values())))
    name = "Position error of a coarse time-of-flight camera, corners / with planes"
    return at_least(name, _rms(corners) / _rms(both), 2)


def _coverage_section(inside: Mapping[str, int], rigs: int) -> Section:
    columns = (Column("parameters"), Column(f"inside, of {rigs}"))
    return Section("Coverage", (Table("Rigs with the truth in the 95 % region", columns, tuple(inside.items())),))


def _planes_section(planes: Mapping[float, NDArray[np.float64]]) -> Section:
    columns = (
        Column("corners to", "px", ".1f"), Column("from"), Column("rms", "mm", ".2f"),
        Column("median", "mm", ".2f"), Column("smallest", "mm", ".2f"), Column("largest", "mm", ".2f"),
    )  # fmt: skip
    rows = tuple(
        (sigma, name, _rms(errors), float(np.median(errors)), float(errors.min()), float(errors.max()))
        for sigma, both in planes.items()
        for name, errors in zip(("corners", "corners and planes"), both)
    )
    return Section("Planes", (Table("Position error of a coarse time-of-flight camera", columns, rows),))


def _rms(errors: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


def _published(data: Path) -> Section:
    """Calibrations of the published boards beside the published parameters."""
    views, published = published_boards.circles(data / FOLDERS[0])
    rows = _intrinsics("circle grid", calibrate(_task("camera", (640, 480), BROWN_CONRADY, views)), published.matrix)
    sides = {side: SensorTask(640, 480) for side in ("left", "right")}
    stereo = calibrate(Task(sides, published_boards.stereo(data / FOLDERS[1]), (), "left"))
    views, cameras = published_boards.azure(data / FOLDERS[2])
    color = calibrate(_task("color", (4096, 3072), RATIONAL, [view for view in views if view.sensor == "color"]))
    rows += _intrinsics("Azure Kinect, colour", color, cameras["color"].matrix)
    fx, fy, cx, cy = cameras["infrared"].matrix.tolist()
    known = Camera(1024, 1024, fx, fy, cx, cy, Lens(cameras["infrared"].lens))
    infrared = SensorTask(1024, 1024, RATIONAL, (known,), fixed_intrinsics=True)
    both = Task(
        {"color": SensorTask(4096, 3072, RATIONAL), "infrared": infrared}, views, (), "color", min_views_fixed=1
    )
    columns = (
        Column("data"), Column("parameter"), Column("found", "px", ".2f"), Column("±", "px", ".2f"),
        Column("published", "px", ".2f"),
    )  # fmt: skip
    texts = (
        _extrinsics("Stereo pair", stereo, "right"),
        assess(stereo, 0.4, 3.0).verdict,
        _extrinsics("Azure Kinect, infra-red to colour", calibrate(both), "infrared"),
    )
    return Section("Published boards", (Table("Intrinsics", columns, tuple(rows)), *texts))


def _task(name: str, size: tuple[int, int], kind: LensKind, views: list[CornerView]) -> Task:
    return Task({name: SensorTask(*size, kind)}, views, (), name)


def _intrinsics(data: str, solution: Solution, published: NDArray[np.float64]) -> list[tuple[Cell, ...]]:
    pairs = zip(solution.parameters[:4], published.tolist(), strict=True)
    return [(data, one.name, one.value, one.sigma, other) for one, other in pairs]


def _extrinsics(name: str, solution: Solution, sensor: str) -> str:
    turn, move = pose.to_rotation_vector(solution.cameras[sensor].T_rs)
    sigma = {each.name: each.sigma for each in solution.parameters}
    spread = [round(sigma[f"{sensor}.{axis}"] * 1e3, 2) for axis in "xyz"]
    return f"{name}: T = {np.round(move * 1e3, 2)} ± {spread} mm, rotation {np.round(np.degrees(turn), 3)} degrees."
