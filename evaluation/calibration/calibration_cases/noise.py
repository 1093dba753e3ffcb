"""Noise that is stated too small: steps of a sensor finer than the file says, and pixels that repeat one value."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.config import plugins
from calib.noise.base import DepthNoise
from calib.noise.per_pixel import PerPixel
from calib.sequences import selection
from drivers.simulated.address import parse
from evaluation.calibration.calibration_cases.case import Bench, Case, Outcome, Said
from evaluation.experiment import at_least, at_most

#: Standard deviation of the real sensor at 2.5 m, by NumPy from frame to frame [m].
_PETIT_M = 9.3e-3

#: Standard deviations of the walls whose noise no curve follows [m], and their distances [m].
_UNEVEN = {0.8: 0.001, 1.1: 0.03, 1.4: 0.001, 1.7: 0.03, 2.0: 0.001}


def cases(units_mm: Sequence[float]) -> tuple[Case, ...]:
    """Silent failures 2 and 3.

    Args:
        units_mm: units in which the real distances are stored [mm].
    """
    found = {1.0: "8.2 mm", 0.2: "0.057 mm", 0.1: "0.028 mm"}
    return (
        *(
            Case(
                f"2 noise: real structured light stored in {unit:g} mm, σ at 2.5 m (NumPy: 9.3 mm)",
                found[unit],
                lambda bench, unit=unit: real_unit(bench, unit),
            )
            for unit in units_mm
        ),
        Case(
            "2 noise: simulated structured light stored in 0.1 mm, σ at 1.2 m over the truth",
            "6 to 460 times too small",
            finer_unit,
            brief=False,
        ),
        Case(
            "2 noise: σ of 1 and 30 mm at every other distance, which no curve follows",
            "good or doubtful, written",
            uneven,
        ),
        Case("3 noise: all pixels repeat one value, least σ over step/√12", "2e-9 in 11.6 % of the pixels", repeating),
        Case(
            "3 noise: a map of pixels, half of which repeat one value, likewise",
            "2e-9 in 11.6 % of the pixels",
            map_of_pixels,
        ),
    )


def real_unit(bench: Bench, unit_mm: float) -> Outcome:
    """A real sequence, stored in another unit."""
    for path in sorted(bench.real("sl_rgbd_deform_petit").glob("depth_mm_*.png")):
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if image is None:
            raise FileNotFoundError(path)
        stored = np.rint(image / unit_mm).clip(0, 65535).astype(np.uint16)
        cv2.imwrite(str(bench.folder / path.name.replace("depth_mm", "depth")), stored)
    _camera(bench.folder, 320, 240, 275.0, unit_mm)
    said = bench.run("calibrate", "noise", bench.folder, "--camera", "camera.toml", "--out", "noise")
    sigma = _sigma(bench, 2.5)
    return Outcome(
        f"{sigma * 1e3:.3g} mm, exit code {said.code}",
        (at_least("σ over NumPy's", sigma / _PETIT_M, 0.8), at_most("σ over NumPy's", sigma / _PETIT_M, 1.25)),
    )


def finer_unit(bench: Bench) -> Outcome:
    """Simulated steps of a structured light sensor, in a file of a finer unit."""
    said, head = _walls(bench, "structured_light&structured_light=96x72", (0.8, 1.2, 1.6))
    ratio = _sigma(bench, 1.2) / (1.2**2 * np.hypot(head.noise.random, head.noise.step / np.sqrt(12)))
    return Outcome(
        f"{ratio:.2f}, exit code {said.code}", (at_least("σ / truth", ratio, 0.8), at_most("σ / truth", ratio, 1.25))
    )


def repeating(bench: Bench) -> Outcome:
    """Random errors of a twentieth of the steps: nearly all pixels say the same in each frame."""
    said, head = _walls(bench, "structured_light&noise=0.05&structured_light=48x36", (0.8, 1.2, 1.6))
    model = _model(bench)
    rows, columns = (part.ravel() for part in np.indices((36, 48)))
    least = [
        float(model.deviation(x, x, (rows, columns)).min()) / (head.noise.step * distance**2 / np.sqrt(12))
        for distance in (0.8, 1.2, 1.6)
        for x in [np.full(rows.size, distance)]
    ]
    kind = "map of pixels" if isinstance(model, PerPixel) else "no map"
    return Outcome(f"{min(least):.2f} ({kind}), exit code {said.code}", (at_least("least σ", min(least), 0.6),))


def map_of_pixels(bench: Bench) -> Outcome:
    """Pixels with offsets of their own, in steps of 1 mm; a half scatters by 2 mm, the others by 0.05."""
    random = np.random.default_rng(0)
    offsets = random.normal(0, 0.005, (36, 48))
    sigmas = np.where(random.random((36, 48)) < 0.5, 0.002, 5e-5)
    images = {
        distance: [distance + offsets + random.normal(0, sigmas) for _ in range(40)] for distance in (0.8, 1.2, 1.6)
    }
    said = _noise_of(bench, images, 1.0)
    model = _model(bench)
    rows, columns = (part.ravel() for part in np.indices((36, 48)))
    x = np.full(offsets.size, 1.2)
    found = model.deviation(x, x, (rows, columns)) / (0.001 / np.sqrt(12))
    kind = "map of pixels" if isinstance(model, PerPixel) else "no map"
    return Outcome(
        f"{found.min():.2f} ({kind}), exit code {said.code}",
        (at_least("least σ", float(found.min()), 0.8), at_least("a map of pixels", isinstance(model, PerPixel), 1)),
    )


def uneven(bench: Bench) -> Outcome:
    """Walls whose noise no smooth curve follows."""
    random = np.random.default_rng(0)
    images = {
        distance: [distance + random.normal(0, sigma, (48, 64)) for _ in range(30)]
        for distance, sigma in _UNEVEN.items()
    }
    said = _noise_of(bench, images, 1.0)
    reason = said.line("bad ")
    return Outcome(
        f"exit code {said.code}: {reason}",
        (
            at_least("exit code", said.code, 2),
            at_most("models written", bench.exists("noise.toml"), 0),
            at_most("raw warnings", said.count("Warning:"), 0),
        ),
    )


def _walls(bench: Bench, sensor: str, distances: Sequence[float]):
    """Exit of `calibrate noise` of simulated walls, stored in 0.1 mm, and the sensor's head."""
    images, heads = {}, []
    for distance in distances:
        simulation = parse(f"simulated://wall?sensors={sensor}&distance={distance}&tilt=6").build()
        heads += simulation.heads.values()
        images[distance] = [frame.si() for k in range(20) for frame in simulation.frames(k)]
    return _noise_of(bench, images, 0.1, heads[0].camera.fx), heads[0]


def _noise_of(
    bench: Bench, images: Mapping[float, Sequence[NDArray[np.floating]]], unit_mm: float, focal: float = 60.0
) -> Said:
    """Exit of `calibrate noise` of folders of z images [m], by the distance of the wall that they show."""
    folders = []
    for distance, taken in images.items():
        folders.append(bench.folder / f"wall_{distance:g}")
        folders[-1].mkdir()
        for number, lengths in enumerate(taken):
            stored = np.rint(np.nan_to_num(lengths) / (unit_mm * 1e-3)).astype(np.uint16)
            cv2.imwrite(str(folders[-1] / f"depth_{number:03}.png"), stored)
        height, width = taken[0].shape
        _camera(bench.folder, width, height, focal, unit_mm)
    given = ("--camera", "camera.toml", "--out", "noise", "--distance-m", *images)
    return bench.run("calibrate", "noise", *folders, *given)


def _camera(folder: Path, width: int, height: int, focal: float, unit_mm: float) -> None:
    keys = f"width = {width}\nheight = {height}\nfx = {focal}\nfy = {focal}\ncx = {width / 2}\ncy = {height / 2}\n"
    (folder / "camera.toml").write_text(f"[depth]\n{keys}depth_scale = {unit_mm * 1e-3}\n", encoding="utf-8")


def _model(bench: Bench) -> DepthNoise:
    """The model that was written; raises FileNotFoundError if none was."""
    (sensor,) = tomllib.loads((bench.folder / "noise.toml").read_text(encoding="utf-8"))["sensors"].values()
    return plugins.load("calib.noise", sensor["noise"], bench.folder).build()


def _sigma(bench: Bench, distance: float) -> float:
    """σ of the model that was written [m]; NaN if none was."""
    return selection.typical_sigma(_model(bench), distance, 0.0) if bench.exists("noise.toml") else np.nan
