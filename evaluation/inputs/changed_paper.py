"""The real sheet of paper, with images changed as other sensors, places, exposures and computers would change them.

No setting was chosen on these images but six. The 4 mm of noise and the extended outline were added on 2026-11-27,
when a tracker had learnt to take noise and outlines from its images, and had been looked at with this sheet, 2 to 8 mm
of noise and outlines that wander by 2 to 6 px; so was the noise that neighbours share on 2026-11-28, and that day 40 %
of dropouts, with which no object was found before (looked at with 15 to 60 % of them), and a person who holds the
sheet, looked at while tries of CMA-ES in vain got pauses; images left out at random on 2026-11-30, looked at with five
other seeds when searches that end beside the print were begun anew, and that day up to ten of them, and a sheet that is
upside down from the middle on, as after a pause, when keypoints of a print were recognised. Each change is tracked with
colour and by depth alone, before nothing, by `nurbs` with all defaults, and compared with the measured points. Depth
alone does not tell which end of a sheet is up.

Statistic and goals, those of the unchanged sheet (`recordings`): over all of them, median frame at most 3 mm, worst
15 mm, 85 to 99 % of the points in their 95 % region, no frame TRACKING and wrong. At most two meshes: one that began
cut by the image's border may be made anew when more of the sheet is seen. Points are bound to that one, too, since the
evening of 2026-11-28; before, all frames after it counted as outside their regions.
Seeds: the context's, of noise, dropouts and images left out.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

import abs_service as a
from abs_service.report.content import Section
from evaluation.experiment import Context, Findings, UnavailableError
from evaluation.inputs.recordings import kinect_paper
from evaluation.inputs.recordings.kinect_paper import CAMERA, Cell, Frame, Truth
from evaluation.inputs.recordings.kinect_paper_report import errors_table, goals

__all__ = ["QUICK", "TITLE", "Settings", "run"]

TITLE = "Changed images of a real sheet: resolution, rate, steps, dropouts, noise, exposure, a cut image"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        frames: of the 16 frames of the sheet with a truth, from the first one on; at least 2.
        changes: how many of the changes.
    """

    frames: int = 16
    changes: int = 17


MESHES = 2

QUICK = Settings(frames=2, changes=2)

#: Colours (height, width, 3) of a frame.
Colors = NDArray[np.uint8]


@dataclass(frozen=True)
class Change:
    """A change of all images.

    Attributes:
        name: in words.
        stride: distance of the pixels that are kept, in rows and columns.
        left: number of columns at the left that are cut off.
        every: distance of the frames that are kept.
        left_out: largest number of frames in a row that are left out at random, of those without a truth.
        upright: part of the sequence, 0…1, after which the scene is turned by 180° around the optical axis.
        cells: ways to track it.
        depth: changes z (height, width) [m], 0 without a return.
        color: changes the colours of a frame, given its part of the sequence, 0…1.
    """

    name: str
    stride: int = 1
    left: int = 0
    every: int = 1
    left_out: int = 0
    upright: float = 1.0
    cells: tuple[Cell, ...] = (Cell(True, False, "nurbs"), Cell(False, False, "nurbs"))
    depth: Callable[[NDArray[np.float64], np.random.Generator], NDArray[np.float64]] = lambda z, generator: z
    color: Callable[[Colors, float], Colors] = lambda image, part: image

    @property
    def camera(self) -> a.Camera:
        """The camera of the pixels that are kept."""
        fx, fy, cx, cy = (value / self.stride for value in (CAMERA.fx, CAMERA.fy, CAMERA.cx - self.left, CAMERA.cy))
        width, height = (640 - self.left) // self.stride, 480 // self.stride
        return replace(CAMERA, width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy)

    def images(self, folder: Path, cell: Cell, known: Collection[int], seed: int) -> Iterator[Frame]:
        """Every image that is kept, changed, up to the last of those with these numbers, which have a truth."""
        generator, last, pause = np.random.default_rng(seed), max(known), 0
        for number, depth_m, image in islice(kinect_paper.images(folder, cell, last), 0, None, self.every):
            if pause and number not in known:
                pause -= 1
                continue
            pause = int(generator.integers(self.left_out, endpoint=True))
            kept = np.s_[:: self.stride, self.left :: self.stride]
            colors = None if image is None else self.color(image, number / last)[kept]
            frame = number, self.depth(depth_m, generator)[kept], colors
            yield frame if number <= self.upright * last else _turned(frame)

    def truth(self, known: Truth) -> Truth:
        """The measured points where the changed images show them."""
        upright = np.array(known.numbers) <= self.upright * max(known.numbers)
        return replace(known, points=np.where(upright[:, None, None], known.points, known.points * (-1, -1, 1)))


def _turned(frame: Frame) -> Frame:
    """The frame turned by 180° around the principal point, (320, 240)."""
    number, depth_m, colors = frame
    turned = partial(np.roll, shift=(1, 1), axis=(0, 1))
    return number, turned(depth_m[::-1, ::-1]), None if colors is None else turned(colors[::-1, ::-1])


def _steps(z: NDArray[np.float64], generator: np.random.Generator) -> NDArray[np.float64]:
    return np.round(z / 0.005) * 0.005


def _dropouts(z: NDArray[np.float64], generator: np.random.Generator, share: float = 0.15) -> NDArray[np.float64]:
    return np.where(generator.random(z.shape) < share, 0, z)


def _noise(z: NDArray[np.float64], generator: np.random.Generator, sigma: float = 0.0015) -> NDArray[np.float64]:
    return np.where(z > 0, z + generator.normal(0, sigma, z.shape), 0)


def _shared(z: NDArray[np.float64], generator: np.random.Generator) -> NDArray[np.float64]:
    """2 mm of noise that pixels share within some 20 px, as those of stereo cameras do, anew in every image."""
    wander = gaussian_filter(generator.standard_normal(z.shape), 20)
    return np.where(z > 0, z + 0.002 * wander / wander.std(), 0)


def _ragged(z: NDArray[np.float64], generator: np.random.Generator) -> NDArray[np.float64]:
    """The sheet extended beyond its outline by 4 ± 3 px, as stereo cameras do, anew in every image."""
    off, nearest = cv2.distanceTransformWithLabels(
        (z == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    seen = z > 0
    of_label = np.zeros(int(nearest.max()) + 1)
    of_label[nearest[seen]] = z[seen]
    wander = gaussian_filter(generator.standard_normal(z.shape), 12)
    inside = cv2.distanceTransform(seen.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    reach = 4 + 3 * wander / wander.std()
    return np.where(np.where(seen, -inside, off) < reach, of_label[nearest], 0)


def _held(z: NDArray[np.float64], generator: np.random.Generator) -> NDArray[np.float64]:
    """Two hands on the sides, their arms, a body 0.3 m behind, a wall at 1.6 m, and 1.5 mm of noise."""
    y, x = np.nonzero(z)
    body_m = float(np.median(z[y, x])) + 0.3
    behind, before = np.full(z.shape, 1.6), np.full(z.shape, np.inf)
    behind[:, 200:520] = body_m - 0.03 * np.cos((np.arange(200, 520) - 360) / 110)
    for upper, lower, outwards in ((np.argmin(x + y), np.argmax(y - x), -1), (np.argmax(x - y), np.argmax(x + y), 1)):
        column, row = (int(0.6 * along[upper] + 0.4 * along[lower]) for along in (x, y))  # there a hand holds the paper
        hand_m = float(np.median(z[row - 3 : row + 4, column - 6 * outwards]))
        for along in np.linspace(1, 0, 60):
            place = int(column + outwards * (25 + 35 * along)), int(row + 5 - 155 * along)
            arm = cv2.circle(np.zeros(z.shape, np.uint8), place, 22, 1, -1) > 0
            behind[arm] = np.minimum(behind[arm], hand_m + 0.01 + along * (body_m - hand_m))
        hand = cv2.ellipse(np.zeros(z.shape, np.uint8), (column + 10 * outwards, row), (38, 26), 0, 0, 360, 1, -1)
        before[hand > 0] = hand_m - 0.015
    return np.minimum(np.where(z > 0, z, behind), before) + generator.normal(0, 0.0015, z.shape)


def _darker(image: Colors, part: float) -> Colors:
    return (image * (1 - 0.4 * part)).astype(np.uint8)


CHANGES = (
    Change("as they are"),
    Change("half the resolution", stride=2),
    Change("a quarter of the resolution", stride=4),
    Change("every third frame, 10 Hz", every=3),
    Change("up to six images in a row left out", left_out=6),
    Change("up to ten images in a row left out", left_out=10),
    Change("upside down from the middle on", upright=0.5, cells=(Cell(True, False, "nurbs"),)),
    Change("steps of 5 mm", depth=_steps),
    Change("15 % of the pixels without depth", depth=_dropouts),
    Change("40 % of the pixels without depth", depth=partial(_dropouts, share=0.4)),
    Change("1.5 mm of noise", depth=_noise),
    Change("4 mm of noise", depth=partial(_noise, sigma=0.004)),
    Change("2 mm of noise, shared within 20 px", depth=_shared),
    Change("outline extended by 4 ± 3 px", depth=_ragged),
    Change("left 250 columns cut off", left=250),
    Change("exposure falls by 40 %", color=_darker),
    Change("held by a person before a wall", depth=_held),
)


def run(settings: Settings, context: Context) -> Findings:
    """Tracks the sheet with every change.

    Raises:
        UnavailableError: the recording is not there.
    """
    if context.data is None or not (context.data / kinect_paper.FOLDER / "truth.npz").exists():
        raise UnavailableError(f"needs --data DIR, a folder with {kinect_paper.FOLDER}")
    folder, runs = context.data / kinect_paper.FOLDER, []
    known = kinect_paper.truth(folder, settings.frames)
    for change in CHANGES[: settings.changes]:
        for cell in change.cells:
            name = f"{change.name}, {'colour + depth' if cell.color else 'depth only'}"
            context.progress(name)
            color = change.camera if cell.color else None
            tracker = a.Tracker(depth=change.camera, color=color, model=a.Nurbs())
            images = change.images(folder, cell, known.numbers, context.seed)
            runs.append(kinect_paper.follow(name, tracker, images, change.truth(known)))
    section = Section("Errors with changed images", (_WHAT, errors_table(runs)))
    return Findings(
        goals(runs, "Changed images", f"of {len(runs)}", MESHES), (section,), {"changes": [one.name for one in runs]}
    )


_WHAT = (
    "The same images and truth as those of the recording of a bent sheet of paper, where the columns are explained. "
    "Noise, steps and dropouts are beyond what the default noise model of the sensor knows of; nobody tells the "
    "tracker."
)
