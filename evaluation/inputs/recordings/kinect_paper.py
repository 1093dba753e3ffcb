"""A real sheet of paper that two hands bend before a Kinect v1, with material points that were measured beside it.

The images have no licence, so neither they nor parts of them are in this repository, and pictures show their edges
only.
"""

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

import abs_service as a
from evaluation.inputs.recordings import features
from evaluation.inputs.recordings.binding import Binding, Points, bind
from evaluation.statistics import inside_region

FOLDER = "sl_kinect_paper"

#: From the data's own description; colour and depth images have the same camera.
CAMERA = a.Camera(640, 480, fx=528.0144, fy=528.0144, cx=320.0, cy=240.0)
RATE_HZ = 30.0

#: The measured points and the depth image of a number show what the colour image with this much larger a number shows:
#: optical flow between colour images takes the points of every frame with a truth to those of the next one within 0.2
#: to 0.5 px then, and within 0.4 to 6 px without (`beside_flow`).
COLORS_LATER = 1

#: z of a wall behind the sheet [m], where the data has no background.
WALL_M = 0.85

#: A frame is wrong if its median error is above this many of its own claimed σ, and above this [mm].
WRONG_SIGMA, WRONG_MM = 3.0, 5.0


#: Number, z (height, width) [m] and colours (height, width, 3), if any.
Frame = tuple[int, Points, NDArray[np.uint8] | None]


@dataclass(frozen=True)
class Cell:
    """One way of tracking the sheet: with colours or without, before a wall or nothing, with which model."""

    color: bool
    wall: bool
    model: str

    @property
    def name(self) -> str:
        """Name in words."""
        return f"{'colour + depth' if self.color else 'depth only'}, {'wall' if self.wall else 'no wall'}, {self.model}"

    def tracker(self) -> a.Tracker:
        """A tracker with the defaults of a user, of whom only cameras and model are asked."""
        model = a.Nurbs() if self.model == "nurbs" else a.FlexPad()
        return a.Tracker(depth=CAMERA, color=CAMERA if self.color else None, model=model)


CELLS = tuple(Cell(*one) for one in product((True, False), (True, False), ("nurbs", "flexpad")))


@dataclass(frozen=True, eq=False)
class Truth:
    """Measured material points (frames, n, 3) [m] in the frames of these numbers, and σ of every coordinate [m]."""

    numbers: tuple[int, ...]
    points: Points
    sigma: float


@dataclass(frozen=True)
class MaterialErrors:
    """Errors of the bound points in one frame with a truth; NaN without an estimate.

    Attributes:
        number: of the frame.
        status: of the estimate.
        median_mm, p95_mm, maximum_mm: distance of the points from the measured ones [mm].
        across_mm: median distance along the normal of the mesh [mm]: what is not sliding.
        claimed_mm: σ of a coordinate by the estimate's covariances, root mean square [mm]; NaN while LOST.
        inside: share of the points in their own 95 % region, by the claimed covariance and the truth's σ.
        inside_twice: the same with the truth's σ twice, since the points were bound to measured places, too.
    """

    number: int
    status: a.Status
    median_mm: float
    p95_mm: float
    maximum_mm: float
    across_mm: float
    claimed_mm: float
    inside: float
    inside_twice: float

    @property
    def wrong(self) -> bool:
        """True if the error is above what the estimate claims, and it is said to be TRACKING."""
        bound = np.fmax(WRONG_SIGMA * self.claimed_mm, WRONG_MM)
        return self.status == a.Status.TRACKING and bool(self.median_mm > bound)


@dataclass(frozen=True, eq=False)
class PaperRun:
    """One way of tracking the sheet.

    Attributes:
        name: of the way.
        errors: in every frame with a truth after those in which the points are bound: the first, and that in which a
            mesh that the tracker has made anew is seen first.
        bound, beyond: how many of the measured points are bound to the first mesh, and how many are beyond it.
        meshes: how many meshes the tracker made.
        tracking: share of all frames that are TRACKING.
        solve_ms: CPU time of every frame but the first [ms].
        shown: estimates of the first and the last frame with a truth.
    """

    name: str
    errors: tuple[MaterialErrors, ...]
    bound: int
    beyond: int
    meshes: int
    tracking: float
    solve_ms: NDArray[np.float64]
    shown: tuple[a.Estimate, a.Estimate]


class UnboundError(RuntimeError):
    """The sheet is not found in the first frame."""


def truth(folder: Path, frames: int) -> Truth:
    """The measured points of the first frames that have some, and a colour image."""
    with np.load(folder / "truth.npz") as stored:
        numbers = [int(number) for number in stored["frames"][:frames] if _color_path(folder, int(number)).exists()]
        points = stored["points_mm"][: len(numbers)] * 1e-3
        return Truth(tuple(numbers), points, float(stored["sigma_mm"]) * 1e-3)


def beside_flow(folder: Path, known: Truth, later: int = COLORS_LATER) -> NDArray[np.float64]:
    """Median distance (frames − 1,) [px] of measured points from where the images show them to have gone.

    That is, from where optical flow takes them since the frame with a truth before; without the tracker.

    Args:
        folder: of the recording.
        known: the measured points.
        later: difference of the numbers of a colour image and of the points that it is taken to show.
    """
    result = []
    for before, after, (first, last) in zip(known.points[:-1], known.points[1:], pairwise(known.numbers), strict=True):
        shown = [cv2.cvtColor(color(folder, k, later), cv2.COLOR_RGB2GRAY) for k in range(first, last + 1)]
        grey = [np.asarray(image, np.uint8) for image in shown]
        everywhere = [np.ones(image.shape, bool) for image in grey]
        there = features.tracks(grey, everywhere, CAMERA.project(before))[-1]
        miss = np.linalg.norm(CAMERA.project(after) - there, axis=1)
        result.append(np.nanmedian(miss) if np.isfinite(miss).any() else np.nan)
    return np.array(result)


def images(folder: Path, cell: Cell, last: int) -> Iterator[Frame]:
    """Number, z (height, width) [m] and colours (height, width, 3) of every frame up to a number."""
    for path in sorted(folder.glob("depth_*.png")):
        number = int(path.stem.removeprefix("depth_"))
        if number <= last:
            depth_m = _image(path, cv2.IMREAD_UNCHANGED) * 0.0001
            if cell.wall:
                depth_m[depth_m == 0] = WALL_M  # nothing is missing within the sheet
            yield number, depth_m, color(folder, number) if cell.color else None


def color(folder: Path, number: int, later: int = COLORS_LATER) -> NDArray[np.uint8]:
    """Red, green, blue (height, width, 3) of what the points and the depth image of this number show."""
    return np.asarray(_image(_color_path(folder, number, later), cv2.IMREAD_COLOR_RGB), np.uint8)


def follow(name: str, tracker: a.Tracker, frames: Iterable[Frame], known: Truth) -> PaperRun:
    """Tracks the sheet with a new tracker and compares it with the truth, in those frames with one that are given.

    Raises:
        UnboundError: the sheet is not found in the first frame.
    """
    tracker.warm_up()
    estimates: dict[int, a.Estimate] = {}
    solve_ms = []
    for number, depth_m, image in frames:
        begin_ns = time.process_time_ns()
        estimates[number] = tracker.track(depth_m, time_s=number / RATE_HZ, image=image)
        solve_ms.append((time.process_time_ns() - begin_ns) * 1e-6)
    truths = [(number, points) for number, points in zip(known.numbers, known.points) if number in estimates]
    first, last = (estimates[truths[k][0]] for k in (0, -1))
    if not len(first.faces):
        raise UnboundError(f"{name}: {', '.join(first.reasons)}")
    bindings, errors, version = [bind(truths[0][1], first.vertices, first.faces)], [], first.mesh_version
    for number, points in truths[1:]:
        estimate = estimates[number]
        if estimate.mesh_version != version and np.isfinite(estimate.vertices).all():
            bindings.append(bind(points, estimate.vertices, estimate.faces))
            version = estimate.mesh_version
        else:
            errors.append(_errors(number, bindings[-1], estimate, points, known.sigma))
    bound, tracking = bindings[0].bound, [one.status == a.Status.TRACKING for one in estimates.values()]
    counts = int(bound.sum()), int((~bound).sum()), len(bindings)
    return PaperRun(name, tuple(errors), *counts, float(np.mean(tracking)), np.array(solve_ms[1:]), (first, last))


def _errors(number: int, binding: Binding, estimate: a.Estimate, points: Points, sigma: float) -> MaterialErrors:
    if not np.isfinite(estimate.vertices).all():
        nan = float("nan")
        return MaterialErrors(number, estimate.status, nan, nan, nan, nan, nan, 0.0, 0.0)
    found = binding.points(estimate.vertices)
    covariance = binding.covariance(estimate.vertex_covariance)
    error = found - points[binding.bound]
    size = np.linalg.norm(error, axis=1) * 1e3
    across = np.einsum("ki,ki->k", error, binding.normals(estimate.vertices))
    return MaterialErrors(
        number=number,
        status=estimate.status,
        median_mm=float(np.median(size)),
        p95_mm=float(np.quantile(size, 0.95)),
        maximum_mm=float(size.max()),
        across_mm=float(np.median(np.abs(across)) * 1e3),
        claimed_mm=float(np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean() / 3) * 1e3),
        inside=share_inside(error, covariance + sigma**2 * np.eye(3)),
        inside_twice=share_inside(error, covariance + 2 * sigma**2 * np.eye(3)),
    )


def share_inside(error: Points, covariance: Points) -> float:
    """Share of the errors (n, 3) that are in the 95 % region of their covariances (n, 3, 3); NaN is outside."""
    known = np.isfinite(covariance).all(axis=(1, 2))
    return float(inside_region(error[known], covariance[known]).sum() / len(error))


def _color_path(folder: Path, number: int, later: int = COLORS_LATER) -> Path:
    return folder / f"color_{number + later:06d}.jpg"


def _image(path: Path, flags: int) -> NDArray[Any]:
    image = cv2.imread(str(path), flags)
    if image is None:
        raise FileNotFoundError(path)
    return np.asarray(image)
