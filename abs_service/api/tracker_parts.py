"""Parts of a tracker of arrays, made from a configuration."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from abs_service import config, wiring
from abs_service.api import arguments, checks
from abs_service.api.arrays import FrameBuilder
from abs_service.api.checks import ArgumentError
from abs_service.api.region_or_mask import RegionOrMask
from abs_service.pairing.synchroniser import Synchroniser
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracking.plan import Plan
from abs_service.tracking.session import TrackingSession
from calib.camera import Camera
from calib.noise.base import NoiseError
from calib.rig import Rig


@dataclass(frozen=True, slots=True, eq=False)
class TrackerParts:
    """Parts of one tracker.

    Attributes:
        rig: its sensors.
        plan: its settings.
        region: where the object is looked for; takes the masks.
        session: tracks frame sets.
        frames: makes frame sets of arrays.
        synchroniser: makes one that pairs the frames of a recording.
        budget_ns: time that a search may take [ns].
    """

    rig: Rig
    plan: Plan
    region: RegionOrMask
    session: TrackingSession
    frames: FrameBuilder
    synchroniser: Callable[[], Synchroniser]
    budget_ns: float

    @property
    def camera(self) -> Camera:
        """Camera of the depth images."""
        return self.rig.sensors[self.plan.reference].camera


def tracker_parts(
    settings: config.ServiceConfig,
    name: str,
    cameras: Mapping[str, Camera],
    geometry: str,
    bayer: str,
    budget_ms: float | None,
) -> TrackerParts:
    """The parts of one tracker of a configuration.

    Args:
        settings: the configuration.
        name: which tracker.
        cameras: by sensor.
        geometry, bayer, budget_ms: as for `Tracker`.

    Raises:
        ArgumentError: the configuration has no such tracker, a sensor has no camera, or a part cannot be made.
    """
    try:
        plan = wiring.plan(settings, name)
        rig = wiring.rig(settings, name, cameras)
    except (wiring.PlanError, NoiseError) as error:
        raise ArgumentError(arguments.in_arguments(str(error))) from None
    try:
        region = RegionOrMask(plan.region.build())
    except DetectionError as error:
        raise ArgumentError(f"region.{error}") from None
    try:
        session = TrackingSession(rig, replace(plan, region=region))
    except DetectionError as error:
        raise ArgumentError(f"template.{error}") from None
    if budget_ms is not None:
        checks.positive("budget_ms", budget_ms, "more than 0, or None for no limit")
    return TrackerParts(
        rig,
        plan,
        region,
        session,
        FrameBuilder(rig, plan.reference, geometry, bayer),
        partial(wiring.synchroniser, settings, name, rig.sensors.values()),
        np.inf if budget_ms is None else float(budget_ms) * 1e6,
    )
