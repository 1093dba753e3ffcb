"""Tracking of a recorded strip that hangs from a gripper, for the estimate of its stiffness."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.synchroniser import Synchroniser
from abs_service.tracker.detection.segmentation import detect_object
from abs_service.tracker.detection.strip.elastica import heavy_elastica
from abs_service.tracker.estimates.estimate import Estimate, Status
from abs_service.tracker.models.gravity import Gravity
from abs_service.tracking.bending_stiffness.stiffness import (
    InclinationProfile,
    Stiffness,
    StiffnessError,
    inclination_profile,
    predicted_tip,
)
from abs_service.tracking.observer import Observer
from abs_service.tracking.plan import Plan
from abs_service.tracking.session import TrackingSession
from abs_service.tracking.tracked_sets import track_sets
from calib.rig import Rig
from drivers.contract.frame import Frame, FrameSet
from drivers.replay import Recording


@dataclass(frozen=True, eq=False)
class Profiles:
    """Measured, tracked and predicted profile of the strip in one frame.

    Attributes:
        measured: side view of the depth pixels: horizontal distance from the gripper and drop below it (k, 2) [m].
        tracked: side view of the tracked vertices (n, 2) [m].
        predicted: side view of the nodes of the elastica (m, 2) [m].
        along: arc length from the gripper to the ends of the segments (s + 1,) [m].
        inclination, deviation: tracked angles there and their standard deviation (s + 1,) [rad].
        predicted_along, predicted_inclination: arc length (m,) [m] and inclination (m,) [rad] of the elastica.
    """

    measured: NDArray[np.float64]
    tracked: NDArray[np.float64]
    predicted: NDArray[np.float64]
    along: NDArray[np.float64]
    inclination: NDArray[np.float64]
    deviation: NDArray[np.float64]
    predicted_along: NDArray[np.float64]
    predicted_inclination: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HangingStrip:
    """Result of tracking a strip in a recording.

    Attributes:
        model: model of the strip.
        inclinations: inclination profiles of all tracked frames.
        untracked: number of frame sets without a tracked strip.
        shown: an estimate from the middle of the recording, for the plot.
        pixels: points of the strip from the reference sensor in the same frame (k, 3) [m].
    """

    model: Gravity
    inclinations: list[InclinationProfile]
    untracked: int
    shown: Estimate
    pixels: NDArray[np.float64]

    def profiles(self, found: Stiffness) -> Profiles:
        """Profiles of the frame `shown`, for the plot."""
        model, theta, length = self.model, self.shown.theta, self.model.strip.length
        here = inclination_profile(model, theta, self.shown.covariance)
        tip = predicted_tip(found.load, here)
        shape = heavy_elastica(tip, found.load)
        return Profiles(
            measured=model.side_view(theta, self.pixels),
            tracked=model.side_view(theta, self.shown.vertices.astype(np.float64)),
            predicted=length * shape.points[0],
            along=np.linspace(0, length, model.segments + 1),
            inclination=here.inclination,
            deviation=np.sqrt(np.diag(here.covariance)),
            predicted_along=np.linspace(0, length, len(shape.inclination[0])),
            predicted_inclination=shape.inclination[0],
        )


def track_strip(
    recording: Recording,
    rig: Rig,
    synchroniser: Synchroniser,
    plan: Plan,
    on_image: Callable[[], None] = lambda: None,
) -> HangingStrip:
    """Tracks a recording with a gravity model.

    If the strip was lost and detected again, the mesh with the most tracked frames is used. `on_image` is called after
    every image.

    Raises:
        StiffnessError: no strip was tracked in any frame.
    """
    session, observer = TrackingSession(rig, plan), Observer(rig)
    tracked: dict[int, list[tuple[Gravity, Estimate, FrameSet]]] = {}
    sets = 0
    frame_sets = synchroniser.group(_counted(recording, on_image))
    for frames, estimate, _ in track_sets(session, frame_sets, time.monotonic_ns):
        sets, model = sets + 1, session.model
        if isinstance(model, Gravity) and estimate.status == Status.TRACKING:
            tracked.setdefault(session.mesh_version, []).append((model, estimate, frames))
    if not tracked:
        raise StiffnessError(f"{recording.path}: no strip was tracked in {sets} frame sets")
    longest = max(tracked.values(), key=len)
    model, shown, frames = longest[len(longest) // 2]
    seen = detect_object(observer.observe(frames), rig, plan.reference, plan.region.build(), plan.vertices)
    inclinations = [inclination_profile(model, estimate.theta, estimate.covariance) for _, estimate, _ in longest]
    return HangingStrip(model, inclinations, sets - len(longest), shown, seen.points)


def _counted(recording: Recording, on_image: Callable[[], None]) -> Iterator[Frame]:
    for item in recording.frames():
        if isinstance(item, Frame):
            yield item
            on_image()
