"""What the joint solve makes of published boards and of simulated rigs, as the tables of docs/calibration.md.

python -m evaluation.calibration.cameras            simulated rigs only: a few minutes
python -m evaluation.calibration.cameras FOLDER     published boards as well; FOLDER holds calib_rct_circles, …
"""

import argparse
from pathlib import Path

import numpy as np

from calib import pose
from calib.camera import Camera
from calib.lens import Lens
from calib.solve.bundle.lens_parameters import BROWN_CONRADY, RATIONAL, LensKind
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation.verdict import assess
from calib.views import CornerView
from evaluation.calibration import published_boards, simulated_rig


def main() -> None:
    """Prints all tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path)
    folder = parser.parse_args().folder
    if folder is not None:
        _published(folder)
    _rates()
    _planes()


def _published(folder: Path) -> None:
    views, published = published_boards.circles(folder / "calib_rct_circles")
    solution = calibrate(_alone("camera", (640, 480), BROWN_CONRADY, views))
    _matrix("circle grid", solution, published.matrix)
    views = published_boards.stereo(folder / "calib_opencv_stereo")
    sensors = {side: SensorTask(640, 480) for side in ("left", "right")}
    solution = calibrate(Task(sensors, views, (), "left"))
    _place("stereo pair", solution, "right")
    print(f"  {assess(solution, 0.4, 3.0).verdict}")
    views, cameras = published_boards.azure(folder / "calib_azure_charuco")
    solution = calibrate(_alone("color", (4096, 3072), RATIONAL, [view for view in views if view.sensor == "color"]))
    _matrix("Azure Kinect, colour", solution, cameras["color"].matrix)
    fx, fy, cx, cy = cameras["infrared"].matrix.tolist()
    known = Camera(1024, 1024, fx, fy, cx, cy, Lens(cameras["infrared"].lens))
    infrared = SensorTask(1024, 1024, RATIONAL, (known,), fixed_intrinsics=True)
    both = Task(
        {"color": SensorTask(4096, 3072, RATIONAL), "infrared": infrared}, views, (), "color", min_views_fixed=1
    )
    _place("Azure Kinect, infrared to colour", calibrate(both), "infrared")


def _alone(name: str, size: tuple[int, int], kind: LensKind, views: list[CornerView]) -> Task:
    return Task({name: SensorTask(*size, kind)}, views, (), name)


def _matrix(what: str, solution: Solution, published: np.ndarray) -> None:
    print(f"\n{what}")
    for parameter, other in zip(solution.parameters[:4], published.tolist(), strict=True):
        print(f"  {parameter.name:12} {parameter.value:9.2f} ± {parameter.sigma:.2f}   published {other:9.2f}")
    print(f"  {assess(solution, 1.0, 3.0).verdict}")


def _place(what: str, solution: Solution, sensor: str) -> None:
    turn, move = pose.to_rotation_vector(solution.cameras[sensor].T_rs)
    sigma = {each.name: each.sigma for each in solution.parameters}
    print(f"\n{what}: {np.round(move * 1e3, 2)} mm, {np.round(np.degrees(turn), 3)} degrees")
    print("  ±", [round(sigma[f"{sensor}.{axis}"] * 1e3, 2) for axis in "xyz"], "mm")


def _rates() -> None:
    found = [simulated_rig.surprises(seed) for seed in range(simulated_rig.SEEDS)]
    print(f"\nTruth inside the 95 % region, of {len(found)} simulated rigs")
    for what in found[0]:
        print(f"  {what:18} {sum(each[what] < 0.95 for each in found)}")


def _planes() -> None:
    print("\nError of where a coarse time-of-flight camera stands [mm], median and range over the seeds")
    for corner_sigma in (0.3, simulated_rig.COARSE_PX, 1.0):
        errors = [simulated_rig.tof_errors(seed, corner_sigma) for seed in range(simulated_rig.PLANE_SEEDS)]
        corners, both = np.array(errors).T * 1e3
        rms = np.sqrt(np.mean(corners**2)), np.sqrt(np.mean(both**2))
        print(
            f"  corners to {corner_sigma:.1f} px: alone {np.median(corners):.2f} ({corners.min():.2f} to "
            f"{corners.max():.2f}), with planes {np.median(both):.2f} ({both.min():.2f} to {both.max():.2f}); "
            f"root mean squares {rms[0]:.2f} / {rms[1]:.2f} = {rms[0] / rms[1]:.1f}"
        )


if __name__ == "__main__":
    main()
