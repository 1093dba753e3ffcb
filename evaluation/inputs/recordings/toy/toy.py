"""The real sequence: a soft toy squeezed by a hand, 120 frames of a PrimeSense-type sensor.

The images have no licence, so neither they nor parts of them are in this repository, and pictures show their edges
only.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service import config, wiring
from abs_service.tracker.estimates.estimate import Estimate, Status
from abs_service.tracking.session import TrackingSession
from abs_service.tracking.warmup.board import warm_up
from calib.camera import Camera
from drivers.contract.frame import FrameSet, Kind
from drivers.image_folder.images import ColorImages, DepthImages, ImageFolder
from drivers.image_folder.listing import by_number
from evaluation.inputs.recordings.agreement import Agreement, agreement

#: From the data's own description: 320 × 240, focal length 275 px, centre (160, 120); depth is z in millimetres.
CAMERA = Camera(320, 240, 275.0, 275.0, 160.0, 120.0)
RATE_HZ = 30.0
#: The configuration that users are given for such images.
EXAMPLE = Path(__file__).parents[4] / "examples" / "rigs" / "image_folder.toml"
FOLDER, TRACKER = "sl_rgbd_deform_petit", "toy"

#: What the tracker is given in place of a frame set; None if it is to see nothing of that reference.
Change = Callable[[int, FrameSet], FrameSet | None]


@dataclass(frozen=True, eq=False)
class ReferenceFrame:
    """One frame set with its reference: radial distances [m] and the object's mask (height, width)."""

    frames: FrameSet
    distance: NDArray[np.float32]
    mask: NDArray[np.bool_]
    edges: NDArray[np.uint8]

    @property
    def grey(self) -> NDArray[np.uint8]:
        """Brightness (height, width) of the colour image."""
        color = next(frame for frame in self.frames.frames.values() if frame.kind == Kind.COLOR)
        return np.asarray(cv2.cvtColor(np.ascontiguousarray(color.data, np.uint8), cv2.COLOR_BGR2GRAY), np.uint8)


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """The estimate of one frame set, its mesh and its residuals from the complete depth image.

    Attributes:
        index: of the frame set.
        rest: vertices of the undeformed mesh (n, 3) [m].
        solve_ms: time that the tracker took [ms].
    """

    index: int
    estimate: Estimate
    faces: NDArray[np.int32]
    rest: NDArray[np.float64]
    agreement: Agreement
    solve_ms: float

    @property
    def tracking(self) -> bool:
        """True if the status of the estimate is TRACKING."""
        return self.estimate.status == Status.TRACKING


class Toy:
    """The sequence in memory.

    Args:
        folder: with depth_mm_*.png, color_*.png and masks.
        frames: how many frames, from the first one on.
        mask: name of the object's masks: seg_*.png, the toy and the hand on it, or sponge_*.png, the sponge alone.
    """

    def __init__(self, folder: Path, frames: int, mask: str = "seg"):
        names = ("depth_mm", "color", mask)
        depth, color, masks = (by_number(folder, f"{name}_*.png", RATE_HZ)[:frames] for name in names)
        images = ImageFolder({"depth": DepthImages(depth, CAMERA, 0.001), "color": ColorImages(color, CAMERA)})
        text = EXAMPLE.read_text(encoding="utf-8").replace("mask.png", masks[0].path.resolve().as_posix())
        self._settings = config.loads(text, EXAMPLE.name, folder)
        self._rig = wiring.rig(self._settings, TRACKER, images.cameras)
        synchroniser = wiring.synchroniser(self._settings, TRACKER, self._rig.sensors.values())
        sets = list(synchroniser.group(images.frames()))
        # As the service does before its first image; compiling is no part of a frame's time.
        warm_up(self._rig, wiring.plan(self._settings, TRACKER))
        self.references = [_reference_frame(one, _mask(mask.path)) for one, mask in zip(sets, masks, strict=True)]

    @cached_property
    def budget_ms(self) -> float:
        """Time limit of the live search for a frame set [ms]."""
        return self._settings.trackers[TRACKER].budget_ms

    def tracking(self) -> TrackingSession:
        """A new tracker."""
        return TrackingSession(self._rig, wiring.plan(self._settings, TRACKER))

    def follow(
        self, clock: Callable[[], int], change: Change = lambda _, frames: frames, budget_ms: float = np.inf
    ) -> Iterator[TrackedFrame]:
        """Tracks the sequence.

        Args:
            clock: time [ns], by which the search's time is measured.
            change: replaces the frame set of an index before tracking.
            budget_ms: time limit of a search [ms].
        """
        tracking = self.tracking()
        for index, reference in enumerate(self.references):
            frames = change(index, reference.frames)
            if frames is None:
                continue
            begin_ns = clock()
            estimate = tracking.track(frames, lambda begin_ns=begin_ns: clock() - begin_ns < budget_ms * 1e6)
            solve_ms = (clock() - begin_ns) * 1e-6
            if tracking.mesh is None:
                raise RuntimeError(f"frame {index}: {', '.join(estimate.reasons)}")
            mesh = tracking.mesh
            found = agreement(estimate.vertices, mesh.faces, reference.distance, reference.mask, CAMERA)
            yield TrackedFrame(index, estimate, mesh.faces, mesh.vertices, found, solve_ms)


def medians(frames: Sequence[TrackedFrame]) -> Agreement:
    """The median of every number over some frames."""
    return _reduced(frames, np.median, np.median)


def worst(frames: Sequence[TrackedFrame]) -> Agreement:
    """The largest residuals and the smallest shares of some frames."""
    return _reduced(frames, np.max, np.min)


def _reduced(
    frames: Sequence[TrackedFrame], residuals: Callable[..., np.floating], shares: Callable[..., np.floating]
) -> Agreement:
    found = [frame.agreement for frame in frames]
    return Agreement(
        forward_mm=float(residuals([one.forward_mm for one in found])),
        backward_mm=float(residuals([one.backward_mm for one in found])),
        inside=float(shares([one.inside for one in found])),
        covered=float(shares([one.covered for one in found])),
    )


def _reference_frame(frames: FrameSet, mask: NDArray[np.bool_]) -> ReferenceFrame:
    images = {frame.kind: frame for frame in frames.frames.values()}
    distance = images[Kind.DEPTH].si() * CAMERA.lookup.ray_length.astype(np.float32)
    edges = cv2.Canny(np.ascontiguousarray(images[Kind.COLOR].data, np.uint8), 60, 140)
    return ReferenceFrame(frames, distance, mask, np.asarray(edges, np.uint8))


def _mask(path: Path) -> NDArray[np.bool_]:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FileNotFoundError(path)
    return (np.asarray(image)[..., 3] if image.ndim == 3 else np.asarray(image)) > 0
