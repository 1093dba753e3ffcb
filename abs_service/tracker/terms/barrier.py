"""Term of a light barrier: its reading compared with the crossing of mesh and beam."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import BeamReading, Image
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.terms.base import NO_OCCLUDERS, Bounds, Prediction
from abs_service.tracker.terms.linearization import Part, PointLinearization
from abs_service.tracker.terms.places.keypoints import NOTHING_RECOGNIZED, Recognized
from abs_service.tracker.terms.places.patches import Patches
from abs_service.tracker.terms.sensor_fit import SensorFit
from calib.camera import Camera
from calib.jit import kernel
from calib.noise.images.binary import LightBarrier


class BarrierTerm:
    """−log of the probability of the reading, given whether the mesh crosses the beam, in one frame after the other."""

    finds_occluders = False

    def __init__(self, sensor: str, camera: Camera, faces: NDArray[np.int32], noise: LightBarrier, bounds: Bounds):
        self.sensor = sensor
        self._faces = np.ascontiguousarray(faces, np.int32)
        beam = np.stack([camera.center, camera.center + noise.length_m * camera.T_rs[:3, 2]])
        self._beam = np.ascontiguousarray(beam, np.float32)
        self._noise = noise
        self._bounds = bounds

    def observe(self, image: Image, prediction: Prediction) -> "ObservedBarrier":
        """Takes a reading; an occluder in the beam counts as the object: the noise model holds the error rate."""
        if not isinstance(image, BeamReading):
            raise TypeError(f"sensor {self.sensor} has noise of a light barrier but delivered {type(image).__name__}")
        costs = np.minimum(np.add(self._noise.cost(image.interrupted), self._bounds.inlier), self._bounds.outlier)
        return ObservedBarrier(self.sensor, self._faces, self._beam, costs, image.interrupted)


@dataclass(frozen=True, slots=True, eq=False)
class ObservedBarrier:
    """−log of the probability of one reading, see `ObservedTerm`.

    Attributes:
        sensor: name of the sensor.
        faces: vertex indices (m, 3) of the mesh.
        beam: its ends (2, 3) [m].
        costs: of a mesh that leaves the beam free, and of one that crosses it (2,).
        interrupted: the reading.
    """

    sensor: str
    faces: NDArray[np.int32]
    beam: NDArray[np.float32]
    costs: NDArray[np.float64]
    interrupted: bool

    @property
    def occluders(self) -> NDArray[np.float64]:
        """No points: the position along the beam is unknown."""
        return NO_OCCLUDERS

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """−log P(reading | mesh crosses the beam or not), (population,)."""
        return self.costs[self._crossing(surface).astype(int)]

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> list[Part]:
        """No residuals: the cost is piecewise constant, its derivative zero."""
        return [PointLinearization.empty(sparse_jacobian)]

    def fit(self, surface: Surface) -> SensorFit:
        """Agreement of the single sample with a population of one."""
        agrees = int(self._crossing(surface)[0] == self.interrupted)
        return SensorFit(self.sensor, 1, 0, 1, agrees, -float(self.cost(surface)[0]), float("nan"))

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian, patches: Patches) -> PointLinearization:
        """No residuals: there is no appearance."""
        return PointLinearization.empty(sparse_jacobian)

    @property
    def recognized(self) -> Recognized:
        """No keypoints: there is no appearance."""
        return NOTHING_RECOGNIZED

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Zero: a beam has no vertex."""
        return np.zeros((2, 1))

    def learn(self, surface: Surface) -> None:
        """Learns nothing."""

    def _crossing(self, surface: Surface) -> NDArray[np.bool_]:
        crossing = np.zeros(len(surface.vertices), np.bool_)
        _crossing(surface.vertices, self.faces, self.beam[0], self.beam[1], crossing)
        return crossing


@kernel
def _crossing(
    vertices: NDArray[np.float32],
    faces: NDArray[np.int32],
    begin: NDArray[np.float32],
    end: NDArray[np.float32],
    crossing: NDArray[np.bool_],
) -> None:
    """True for each candidate of which any face intersects the segment from begin to end (3,) [m].

    A line intersects a face if it passes all edges on the same side. The signed volumes that decide the side are the
    barycentric weights of the opposite corners. Adjacent faces share the volume of an edge, so there are no cracks.
    """
    ox, oy, oz = np.float64(begin[0]), np.float64(begin[1]), np.float64(begin[2])
    x, y, z = end[0] - ox, end[1] - oy, end[2] - oz
    for k in range(vertices.shape[0]):
        crossing[k] = False
        for f in range(faces.shape[0]):
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            ax, ay, az = vertices[k, 0, a] - ox, vertices[k, 1, a] - oy, vertices[k, 2, a] - oz
            bx, by, bz = vertices[k, 0, b] - ox, vertices[k, 1, b] - oy, vertices[k, 2, b] - oz
            cx, cy, cz = vertices[k, 0, c] - ox, vertices[k, 1, c] - oy, vertices[k, 2, c] - oz
            ab = x * (ay * bz - az * by) + y * (az * bx - ax * bz) + z * (ax * by - ay * bx)
            bc = x * (by * cz - bz * cy) + y * (bz * cx - bx * cz) + z * (bx * cy - by * cx)
            ca = x * (cy * az - cz * ay) + y * (cz * ax - cx * az) + z * (cx * ay - cy * ax)
            if not ((ab >= 0 and bc >= 0 and ca >= 0) or (ab <= 0 and bc <= 0 and ca <= 0)):
                continue
            total = ab + bc + ca
            if total == 0:  # the segment lies in the face's plane, or the face is a line
                continue
            reach = bc * (ax * x + ay * y + az * z) + ca * (bx * x + by * y + bz * z) + ab * (cx * x + cy * y + cz * z)
            place = reach / total / (x * x + y * y + z * z)
            if 0 <= place <= 1:
                crossing[k] = True
                break
