"""Preview of a tracker: selected pixels, mesh and classes of the mesh's rim."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage
from abs_service.pairing.observation import Observation
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.plausibility import ExtentError, doubts
from abs_service.tracker.detection.regions.base import Region
from abs_service.tracker.detection.segmentation import detect_object
from abs_service.tracker.detection.templates.base import Template
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import ModelError
from abs_service.tracker.terms.depth.outline.first_rim import classified_rim
from abs_service.tracking.monitors.arrival_monitor import ArrivalMonitor
from abs_service.tracking.observer import Observer
from abs_service.tracking.plan import Plan, build_template, derived, make_tracker
from calib.camera import Camera
from calib.rig import Rig
from drivers.contract.frame import FrameSet


class PreviewError(ValueError):
    """Frame set without a depth image to preview."""


@dataclass(frozen=True, slots=True, eq=False)
class FoundMesh:
    """The mesh of a detected object.

    Attributes:
        mesh: undeformed.
        vertices: positions (n, 3) [m] in rig coordinates in the image.
        rim: indices (k,) of the outermost vertices; corners, which have no neighbour inside, are left out.
        classes: `RimClass` (k,) of each.
    """

    mesh: Mesh
    vertices: NDArray[np.float64]
    rim: NDArray[np.intp]
    classes: NDArray[np.uint8]

    @property
    def extents(self) -> tuple[float, float, float]:
        """Extents of the vertices along their principal axes [m], the axis of largest variance first."""
        centered = self.vertices - self.vertices.mean(axis=0)
        along = centered @ np.linalg.svd(centered, full_matrices=False)[2].T
        length, width, height = np.ptp(along, axis=0).tolist()
        return length, width, height


@dataclass(frozen=True, slots=True, eq=False)
class Preview:
    """The object that a tracker would track.

    Attributes:
        number: index of the frame set that is shown: the first one in which the object is found, else the last one
            with a depth image.
        camera: camera of the reference sensor.
        distance: its radial distances (height, width) [m], NaN without return.
        selected: pixels (height, width) that the region selects; none if it finds no object.
        found: the mesh made from them; None if there is none.
        reason: why the first depth image shows no object, "" if it does; if none does, why the last one shows none.
        warnings: doubts about the object, and why tracking would not begin with the status TRACKING.
        derived: numbers that follow from this image unless keys give them, by key.
    """

    number: int
    camera: Camera
    distance: NDArray[np.float32]
    selected: NDArray[np.bool_]
    found: FoundMesh | None
    reason: str
    warnings: tuple[str, ...] = ()
    derived: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


def preview(frame_sets: Iterable[FrameSet], rig: Rig, plan: Plan) -> Preview:
    """Preview of the first frame set in which the object is found.

    Raises:
        PreviewError: the reference sensor delivers no depth image.
        ObservationError: the frames do not fit the rig.
    """
    observer, region, arrival = Observer(rig), plan.region.build(), ArrivalMonitor()
    template = build_template(plan.template, plan.vertices)
    first: Preview | None = None
    last: Preview | None = None
    number = -1
    for number, frames in enumerate(frame_sets):
        seen = _look(number, observer.observe(frames), rig, plan, region, arrival, template)
        if seen is None:
            continue
        first, last = first or seen, seen
        if seen.found is not None:
            return replace(seen, reason=first.reason)
    if last is None:
        raise PreviewError(f"no depth image from {plan.reference} in {number + 1} frame sets")
    return last


def _look(
    number: int,
    observation: Observation,
    rig: Rig,
    plan: Plan,
    region: Region,
    arrival: ArrivalMonitor,
    template: Template,
) -> Preview | None:
    """Preview of one observation; None without a depth image of the reference sensor."""
    image, camera = observation.images.get(plan.reference), rig.sensors[plan.reference].camera
    if not isinstance(image, DepthImage):
        return None
    selected = np.zeros(image.distance.shape, np.bool_)
    try:
        found = partial(detect_object, observation, rig, plan.reference, region, plan.vertices)
        detection = arrival.checked(found, observation.t_host_ns)
        selected = np.isfinite(detection.distance)
        tracker, _, _ = make_tracker(plan, template, rig, detection, observation)
    except (DetectionError, ModelError) as error:
        warned = (str(error),) if isinstance(error, ExtentError) else ()
        return Preview(number, camera, image.distance, selected, None, str(error), warned)
    model, first = tracker.model, tracker.track(observation, lambda: True)
    surface = model.deform(model.rest[None])
    rim, classes = classified_rim(camera, model.mesh, surface, detection.surroundings)
    found = FoundMesh(model.mesh, surface.vertices[0].T.astype(np.float64), rim.outer, classes)
    early = tuple(f"it would begin {first.status}: {reason}" for reason in first.reasons)
    warned = doubts(detection, model.mesh, observation.images, rig) + early
    return Preview(number, camera, image.distance, selected, found, "", warned, derived(plan, model))
