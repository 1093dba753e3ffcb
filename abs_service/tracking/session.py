"""A tracker over time: initial detection, tracking, loss and renewed detection."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from enum import Enum, auto
from functools import partial
from typing import NamedTuple

from abs_service.pairing.observation import Observation
from abs_service.tracker.appearance import with_appearance
from abs_service.tracker.detection.grid_mesh import grid_mesh
from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection, UndecidedError
from abs_service.tracker.detection.plausibility import ExtentError
from abs_service.tracker.detection.regions.base import Region
from abs_service.tracker.detection.segmentation import detect_object
from abs_service.tracker.estimates.estimate import Estimate, Status, initializing
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import DeformationModel, ModelError
from abs_service.tracking.monitors import loss_monitor
from abs_service.tracking.monitors.arrival_monitor import ArrivalMonitor
from abs_service.tracking.monitors.growth_monitor import MIN_GROWTH
from abs_service.tracking.observer import Observer
from abs_service.tracking.plan import Plan, build_template, derived, make_tracker
from abs_service.tracking.tracked_object import Built, TrackedObject
from calib.rig import Rig
from drivers.contract.frame import FrameSet


class _Cause(Enum):
    """Cause of a detection."""

    START = auto()  # there is no object yet
    REQUEST = auto()  # a user asked for it
    LOSS = auto()
    APPEARANCE = auto()  # a camera that had no image when the mesh was built has one now
    GROWTH = auto()  # much more of the object is in sight than the mesh has


class _Due(NamedTuple):
    """A detection that is due in this frame."""

    cause: _Cause
    region: Region


class _Failure(NamedTuple):
    """Reasons for which a detection failed; those that are doubts about the object are warnings as well."""

    reasons: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


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
        self._template = build_template(plan.template, plan.vertices)
        self._observer = Observer(rig)
        self._object: TrackedObject | None = None
        self._loss_monitor = loss_monitor.LossMonitor(plan.reinitialization, plan.status)
        self._growth_due = False
        self._arrival_monitor = ArrivalMonitor()
        self._requested: deque[Region] = deque()  # the latest counts; other threads add to it

    @property
    def model(self) -> DeformationModel | None:
        """The deformation model; None before the first detection."""
        return None if self._object is None else self._object.tracker.model

    @property
    def derived(self) -> Mapping[str, tuple[float, ...]]:
        """Numbers that follow from the first image unless keys give them, by key; empty before the first detection."""
        return {} if self._object is None else derived(self._plan, self._object.tracker.model)

    def track(self, frames: FrameSet, in_time: Callable[[], bool]) -> Estimate:
        """The estimate for a frame set, whose search ends when `in_time` is False.

        Raises:
            ObservationError: the frames do not fit the rig.
        """
        if frames.host_clock != self._host_clock:
            self._forget(frames.host_clock)
        return self.track_observation(self._observer.observe(frames), in_time)

    def track_observation(self, observation: Observation, in_time: Callable[[], bool]) -> Estimate:
        """The estimate for an observation, see `track`."""
        due, failure = self._due(observation), _Failure()
        if due is not None:
            failure = self._attempt(due, observation)
        tracked = self._object
        if tracked is None:
            return initializing(observation, failure.reasons, failure.warnings)
        estimate = self._loss_monitor.with_hysteresis(tracked.tracker.track(observation, in_time))
        tracked.vertices = estimate.vertices
        warned = (*tracked.warnings, *tracked.appearance_monitor.warnings)
        if estimate.status == Status.TRACKING:
            self._learn(tracked, estimate, observation)
            return replace(estimate, warnings=warned) if warned else estimate
        reasons = (*estimate.reasons, *(f"looked for the object again: {reason}" for reason in failure.reasons))
        return replace(estimate, reasons=reasons, warnings=warned)

    def reinitialize(self, region: Region | None = None) -> None:
        """Requests a new detection in the next frame set; thread-safe.

        Args:
            region: where the object is; once it is found, used for later detections as well. None: that of the plan.
        """
        self._requested.append(region or self._configured)

    def _forget(self, host_clock: str) -> None:
        """Discards the object: on another clock, the time since the last frame is unknown."""
        self._host_clock = host_clock
        self._object = None
        self._region = self._configured = self._plan.region.build()
        self._loss_monitor = loss_monitor.LossMonitor(self._plan.reinitialization, self._plan.status)
        self._growth_due, self._arrival_monitor = False, ArrivalMonitor()

    def _due(self, observation: Observation) -> _Due | None:
        """The detection that is due in this frame, which then counts as made; None if the object is just tracked."""
        requested = None
        while self._requested:
            requested = self._requested.popleft()
        grow, self._growth_due = self._growth_due, False
        if requested is not None:
            return _Due(_Cause.REQUEST, requested)
        if self._object is None:
            return _Due(_Cause.START, self._region)
        if self._loss_monitor.take_attempt(observation.t_host_ns):
            return _Due(_Cause.LOSS, self._region)
        if not self._loss_monitor.is_lost and self._object.appearance_monitor.take_attempt(
            observation.missing, observation.t_host_ns
        ):
            return _Due(_Cause.APPEARANCE, self._region)
        return _Due(_Cause.GROWTH, self._region) if grow else None

    def _attempt(self, due: _Due, observation: Observation) -> _Failure:
        """Detects the object; a failure leaves everything as it was."""
        try:
            self._detect(due, observation)
        except UndecidedError as error:  # what was asked for is asked again, with more images
            if due.cause == _Cause.REQUEST:
                self._requested.appendleft(due.region)
            self._growth_due = due.cause == _Cause.GROWTH
            return _Failure((str(error),))
        except ExtentError as error:
            return _Failure((str(error),), (str(error),))
        except (DetectionError, ModelError) as error:
            if self._object is not None and due.cause == _Cause.APPEARANCE:
                self._object.appearance_monitor.failed(str(error))
            return _Failure((str(error),))
        return _Failure()

    def _detect(self, due: _Due, observation: Observation) -> None:
        """Detects the object for a cause; DetectionError or ModelError if that fails."""
        tracked = self._object
        if tracked is None or due.cause in (_Cause.START, _Cause.REQUEST):
            self._adopt(self._build(observation, due.region), observation)
            self._region = due.region
        elif due.cause == _Cause.GROWTH:
            self._grow(tracked, observation)
        elif due.cause == _Cause.LOSS and self._loss_monitor.keeps_mesh(observation.t_host_ns):
            self._relocate(tracked, observation)
        else:
            self._renew(tracked, observation)

    def _relocate(self, lost: TrackedObject, observation: Observation) -> None:
        """Fits the mesh of a lost object to the surface that is detected."""
        detection = self._detection(observation, self._region)
        found = with_appearance(grid_mesh(detection), observation.images, self._rig)
        self._loss_monitor.check_likeness(found, lost.mesh)
        lost.tracker.relocate(detection.points)

    def _renew(self, old: TrackedObject, observation: Observation) -> None:
        """Replaces the mesh by a new one of about the same size and colours, or with sides that the first image hid."""
        built = self._build(observation, self._region)
        grown = built.mesh.area > MIN_GROWTH * old.mesh.area and not self._loss_monitor.is_lost
        if not (grown and old.view.hid(built.mesh, old.vertices)):
            self._loss_monitor.check_likeness(built.mesh, old.mesh)
        self._adopt(built, observation)
        self._loss_monitor.restart("a new mesh was made")

    def _grow(self, old: TrackedObject, observation: Observation) -> None:
        """Replaces the mesh if much more of the object is in sight."""
        built = self._build(observation, self._region)
        if built.mesh.area > MIN_GROWTH * old.mesh.area:
            self._adopt(built, observation)
            self._loss_monitor.restart("a larger mesh was made")

    def _learn(self, tracked: TrackedObject, estimate: Estimate, observation: Observation) -> None:
        """Learns from an estimate that can be trusted: vertex offsets, and whether the object continues beyond it."""
        if tracked.growth_monitor.take_attempt(estimate.fits, observation.t_host_ns):
            self._growth_due = True
        surface = tracked.tracker.model.deform(estimate.theta[None])
        image = observation.images.get(self._plan.reference)
        tracked.vertex_offsets.update(image, surface, observation.t_host_ns)

    def _adopt(self, built: Built, observation: Observation) -> None:
        self._object = TrackedObject(built, observation, self._rig, self._plan.reinitialization)
        self.mesh, self.made_ns = built.mesh, observation.t_host_ns
        self.mesh_version += 1

    def _detection(self, observation: Observation, region: Region) -> InitialDetection:
        found = partial(detect_object, observation, self._rig, self._plan.reference, region, self._plan.vertices)
        # What is found again has to be as large as what was lost, so that a part of it will do.
        return self._arrival_monitor.checked(found, observation.t_host_ns) if self._object is None else found()

    def _build(self, observation: Observation, region: Region) -> Built:
        detection = self._detection(observation, region)
        return Built(*make_tracker(self._plan, self._template, self._rig, detection, observation), detection)
