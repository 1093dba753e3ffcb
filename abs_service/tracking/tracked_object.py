"""The object that a session tracks, from its detection to the next one."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.observation import Observation
from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.detection.plausibility import doubts
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.tracker import Tracker
from abs_service.tracking.monitors import loss_monitor
from abs_service.tracking.monitors.appearance_monitor import AppearanceMonitor
from abs_service.tracking.monitors.first_view import FirstView
from abs_service.tracking.monitors.growth_monitor import GrowthMonitor
from abs_service.tracking.offsets.vertex_offsets import VertexOffsets
from calib.noise.base import ImageNoise
from calib.rig import Rig


class Built(NamedTuple):
    """A tracker of a detected object, its mesh, their offsets, and the detection that all are of."""

    tracker: Tracker
    mesh: Mesh
    vertex_offsets: VertexOffsets
    detection: InitialDetection


class TrackedObject:
    """The object that a session tracks.

    Args:
        built: from its detection.
        observation: in which it was detected.
        rig: the sensors.
        settings: of renewed detections.

    Attributes:
        tracker, mesh, vertex_offsets: see `Built`.
        view: the image that the mesh was made from.
        vertices: those of the latest estimate (n, 3) [m].
        warnings: doubts about the detection.
        appearance_monitor, growth_monitor: tell when to build the mesh again.
    """

    def __init__(self, built: Built, observation: Observation, rig: Rig, settings: loss_monitor.Settings):
        self.tracker, self.mesh, self.vertex_offsets, detection = built
        self.view = FirstView(detection, built.mesh)
        self.vertices: NDArray[np.floating] = built.mesh.vertices
        self.warnings = doubts(detection, built.mesh, observation.images, rig)
        unknown = [name for name in observation.missing if isinstance(rig.sensors[name].noise, ImageNoise)]
        self.appearance_monitor = AppearanceMonitor(unknown, settings.every_s)
        self.growth_monitor = GrowthMonitor(settings.grow_s)
