"""A tracker over time: initial detection, tracking, loss and renewed detection."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from abs_service.pairing.observation import Observation
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection, UndecidedError
from abs_service.tracker.detection.plausibility import ExtentError, warnings
from abs_service.tracker.detection.regions.base import Region
from abs_service.tracker.detection.segmentation import detect_object
from abs_service.tracker.estimate import Estimate, Status
from abs_service.tracker.measurements import measurement
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import DeformationModel, ModelError
from abs_service.tracker.optimizers.base import Stop
from abs_service.tracker.shape_quality import ShapeQuality
from abs_service.tracker.tracker import Tracker
from abs_service.tracking.monitors import loss_monitor
from abs_service.tracking.monitors.growth_monitor import LEAST_GROWTH, GrowthMonitor
from abs_service.tracking.observer import Observer
from abs_service.tracking.offsets.vertex_offsets import FixedOffsets, VertexOffsets
from abs_service.tracking.plan import Plan, make_tracker
from calib.noise.base import ImageNoise
from calib.rig import Rig, Sensor
from drivers.contract.frame import FrameSet


class _Begun(NamedTuple):
    """A tracker of a detected object, its mesh, and doubts about the object."""

    tracker: Tracker
    mesh: Mesh
    warnings: tuple[str, ...]


class TrackingSession:
    """One object over time: detected, tracked, lost, detected again.

    Attributes:
        mesh: the undeformed mesh; None before the first detection.
        mesh_version: number of meshes built so far.
        made_ns: time of the frames from which the mesh was built, CLOCK_MONOTONIC [ns].
    """

    def __init__(self, rig: Rig, plan: Plan):
        self.mesh: Mesh | None = None
        self.mesh_version = 0
        self.made_ns = 0
        self._host_clock = ""
        self._rig = rig
        self._plan = plan
        self._region = self._configured = plan.region.build()
        self._template = plan.template.build(plan.vertices)
        self._observer = Observer(rig)
        self._tracker: Tracker | None = None
        self._vertex_offsets: VertexOffsets = FixedOffsets()
        self._loss_monitor = loss_monitor.LossMonitor(plan.reinitialization, plan.status)
        self._growth_monitor = GrowthMonitor(plan.reinitialization.grow_s)
        self._growth_due = False
        self._requested: Region | None = None
        self._without_appearance: frozenset[str] = frozenset()
        self._warnings: tuple[str, ...] = ()

    @property
    def model(self) -> DeformationModel | None:
        """The deformation model; None before the first detection."""
        return None if self._tracker is None else self._tracker.model

    def track(self, frames: FrameSet, in_time: Callable[[], bool]) -> Estimate:
        """The estimate for a frame set.

        Args:
            frames: images of one moment.
            in_time: False after the deadline of the search.

        Raises:
            ObservationError: the frames do not fit the rig.
        """
        if frames.host_clock != self._host_clock:
            self._begin_anew(frames.host_clock)
        return self.track_observation(self._observer.observe(frames), in_time)

    def track_observation(self, observation: Observation, in_time: Callable[[], bool]) -> Estimate:
        """The estimate for an observation, see `track`."""
        requested, self._requested = self._requested, None
        region = requested or self._region
        grow, self._growth_due = self._growth_due, False
        errors: tuple[str, ...] = ()
        doubts: tuple[str, ...] = ()
        try:
            if self._tracker is None or requested:
                self._adopt(self._begin(observation, region), observation)
                self._region = region
            elif self._loss_monitor.attempt_due(observation.t_host_ns) or self._without_appearance.difference(
                observation.missing
            ):
                self._detect_again(self._tracker, observation)
            elif grow:
                self._grow(self._tracker.model.mesh, observation)
        except (DetectionError, ModelError) as error:
            errors = (str(error),)
            if isinstance(error, UndecidedError):  # what was asked for is asked again, with more images
                self._requested, self._growth_due = self._requested or requested, grow
            doubts = errors if isinstance(error, ExtentError) else ()
        if self._tracker is None:
            return _initializing(observation, errors, doubts)
        estimate = self._loss_monitor.with_hysteresis(self._tracker.track(observation, in_time))
        if estimate.status == Status.TRACKING and self._growth_monitor.due(estimate.fits, observation.t_host_ns):
            self._growth_due = True
        if estimate.status == Status.TRACKING:
            surface = self._tracker.model.deform(estimate.theta[None])
            self._vertex_offsets.update(observation.images.get(self._plan.reference), surface, observation.t_host_ns)
        reasons = estimate.reasons + tuple(f"looked for the object again: {error}" for error in errors)
        reasons = () if estimate.status == Status.TRACKING else reasons
        return replace(estimate, reasons=reasons, warnings=self._warnings)

    def reinitialize(self, region: Region | None = None) -> None:
        """Requests a new detection in the next frame set; thread-safe.

        Args:
            region: where the object is; once it is found, used for later detections as well. None: that of the plan.
        """
        self._requested = region or self._configured

    def _begin_anew(self, host_clock: str) -> None:
        """Forgets the object: on another clock, nobody knows how much time has passed since the last frame."""
        self._host_clock = host_clock
        self._tracker = None
        self._region = self._configured = self._plan.region.build()
        self._loss_monitor = loss_monitor.LossMonitor(self._plan.reinitialization, self._plan.status)
        self._growth_due = False

    def _detect_again(self, tracker: Tracker, observation: Observation) -> None:
        """Detects the object again; DetectionError or ModelError if it is not in view or does not match the model."""
        if self._loss_monitor.keeps_mesh(observation.t_host_ns):
            tracker.relocate(self._detect(observation, self._region).points)
            return
        lost = tracker.model.mesh
        begun = self._begin(observation, self._region)
        if self._loss_monitor.differs_in_size(begun.mesh, lost):
            raise DetectionError(f"what is in sight has {begun.mesh.area * 1e4:.0f} cm², not {lost.area * 1e4:.0f} cm²")
        self._adopt(begun, observation)

    def _grow(self, old: Mesh, observation: Observation) -> None:
        """Replaces the mesh if much more of the object is in sight; DetectionError or ModelError if that fails."""
        begun = self._begin(observation, self._region)
        if begun.mesh.area > LEAST_GROWTH * old.area:
            self._adopt(begun, observation)
            self._loss_monitor.restart("a larger mesh was made")

    def _adopt(self, begun: "_Begun", observation: Observation) -> None:
        self._tracker, self.mesh, self._warnings = begun
        self.made_ns = observation.t_host_ns
        self._vertex_offsets = self._plan.vertex_offsets.build(
            begun.tracker.model, self._rig.sensors[self._plan.reference]
        )
        # Their appearance is unknown: once one of them delivers images, mesh and appearance are built again.
        sensors = self._rig.sensors
        self._without_appearance = frozenset(n for n in observation.missing if isinstance(sensors[n].noise, ImageNoise))
        self._growth_monitor = GrowthMonitor(self._plan.reinitialization.grow_s)
        self.mesh_version += 1

    def _detect(self, observation: Observation, region: Region) -> InitialDetection:
        return detect_object(observation, self._rig, self._plan.reference, region, self._plan.vertices)

    def _begin(self, observation: Observation, region: Region) -> "_Begun":
        detection = self._detect(observation, region)
        return _Begun(*make_tracker(self._plan, self._template, self._rig, detection, observation), warnings(detection))


def streams(sensors: Iterable[Sensor]) -> list[tuple[str, str]]:
    """The (head, stream) of every image that the sensors' noise models require; streams are named after their kind."""
    needed = ((sensor.head, kind.value) for sensor in sensors for kind in measurement(sensor.noise).frames)
    return list(dict.fromkeys(needed))


def missing_streams(sensors: Iterable[Sensor], there: Collection[str]) -> list[str]:
    """Streams of the sensors that a recording lacks, as "sensor/stream"."""
    return [name for head, stream in streams(sensors) if (name := f"{head}/{stream}") not in there]


def _initializing(observation: Observation, reasons: tuple[str, ...], warnings: tuple[str, ...]) -> Estimate:
    return Estimate(
        seq=observation.seq,
        t_host_ns=observation.t_host_ns,
        status=Status.INITIALIZING,
        reasons=reasons,
        theta=np.zeros(0),
        covariance=np.zeros((0, 0)),
        vertices=np.zeros((0, 3), np.float32),
        vertex_covariance=np.zeros((0, 3, 3)),
        cost=float("nan"),
        deviation=float("nan"),
        searcher="",
        stop=Stop.NOTHING,
        generations=0,
        evaluations=0,
        budget=0,
        inlier_share=0.0,
        fits=(),
        shape=ShapeQuality(),
        sources=observation.sources,
        missing=observation.missing,
        warnings=warnings,
    )
