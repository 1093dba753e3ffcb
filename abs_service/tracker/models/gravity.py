"""A strip held by a gripper that bends under gravity: segments of constant curvature (eq. 9; Fugl et al.)."""

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
import scipy  # its parts are imported when they are first used
from annotated_types import Interval
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.detection.strip.strip_detection import Strip, find_strip
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.models.parts.arc import arc
from calib import pose
from calib.jit import kernel, prange
from calib.pose import Pose

#: Minimum number of vertex columns per segment; with fewer, curvature and direction cannot be separated.
COLUMNS_PER_SEGMENT = 3

#: Width and height [m] of a hanging board, as narrow as a typical strip.
BOARD = (0.06, 0.3)


@dataclass(frozen=True)
class Settings:
    """TOML keys of the model.

    Attributes:
        segments: number of segments of equal length, each of constant curvature.
        gripper: `free` if the held end moves, so that Θ contains its pose; `fixed` if it stays at its detected pose.
        gravity: direction of gravity in the rig; the default fits a level reference camera.
        towards_gripper: direction in the rig from the free end to the held one; zeros: against gravity.
        length_m: free length of the strip [m]; 0 uses the detected length.
    """

    segments: Annotated[int, Interval(ge=1, le=16)] = 8
    gripper: Literal["free", "fixed"] = "free"
    gravity: tuple[float, float, float] = (0.0, 1.0, 0.0)
    towards_gripper: tuple[float, float, float] = (0.0, 0.0, 0.0)
    length_m: Annotated[float, Interval(ge=0, le=10)] = 0.0

    def __post_init__(self) -> None:
        if not any(self.gravity):
            raise ValueError("gravity must be a direction, not [0, 0, 0]")

    @property
    def board(self) -> tuple[float, float]:
        """Width and height [m] of a flat board from which the model can be built: a hanging one."""
        return (self.length_m / 5, self.length_m) if self.length_m else BOARD

    @property
    def down(self) -> NDArray[np.float64]:
        """Unit vector (3,) of gravity in the rig."""
        return np.array(self.gravity) / np.linalg.norm(self.gravity)

    def build(self, detection: InitialDetection) -> "Gravity":
        """The model of a strip in its detected shape.

        Raises:
            DetectionError: too little is visible, or the object is not a strip.
        """
        held = np.array(self.towards_gripper) if any(self.towards_gripper) else -self.down
        strip = find_strip(detection, self.down, held, self.length_m)
        return Gravity(strip, self.segments, self.gripper == "free", detection.vertices, self.down)


class Gravity:
    """Θ = bending angles of the segments, starting at the gripper [rad]; then the motion of a free gripper.

    Positive angles bend towards the side that faced the sensor. The motion is a rotation vector [rad] about the middle
    of the gripper line and a translation [m], both relative to the detection. The strip keeps its length and width.

    Attributes:
        mesh: a grid on the strip in its detected shape, rows along it.
        rest: the detected angles, no motion.
        scales: (dim,).
        roughness, prior: none (0, dim).
        strip: the detected strip.
        segments: number of segments.
    """

    def __init__(self, strip: Strip, segments: int, is_free: bool, vertices: int, down: NDArray[np.float64]):
        minimum = int(np.ceil((COLUMNS_PER_SEGMENT * segments) ** 2 * strip.width / strip.length))
        flat = strip.flat_mesh(max(vertices, minimum))
        columns = int(flat.chart[:, 0].max()) + 1
        self.strip, self.segments, self._down = strip, segments, down
        self._T_rg, self._step = strip.T_rg, strip.length / segments
        self._along = np.asarray((np.arange(columns) + 0.5) * (strip.length / columns), np.float64)
        self._across = ((flat.vertices[::columns] - strip.T_rg[:3, 3]) @ strip.T_rg[:3, 1]).astype(np.float32)
        arms = strip.length - self._step * (np.arange(segments) + 0.5)
        pose_scales = [np.full(3, 1 / strip.length), np.ones(3)] if is_free else []
        self.rest = np.concatenate([strip.bends(segments), np.zeros(6 if is_free else 0)])
        self.scales = np.concatenate([1 / arms, *pose_scales])
        self.roughness = self.prior = np.zeros((0, len(self.rest)))
        self.mesh = replace(flat, vertices=self.deform(self.rest[None]).vertices[0].T.astype(np.float64))

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """Deforms the mesh with every row of `thetas` (population, dim)."""
        bends = np.ascontiguousarray(thetas[:, : self.segments])
        vertices = np.empty((len(thetas), 3, len(self._along) * len(self._across)), np.float32)
        normals = np.empty_like(vertices)
        _deform(bends, self._step, self._gripper(thetas), self._along, self._across, vertices, normals)
        return Surface(vertices, normals)

    def sparse_jacobian(self, theta: NDArray[np.float64]) -> SparseJacobian:
        """Jacobian of the vertices with respect to theta, at theta (dim,): one group."""
        gripper = self._gripper(theta[None])[0]
        derivatives = self._column_derivatives(theta[: self.segments])
        in_plane = np.stack([derivatives.real, derivatives.imag], axis=-1) @ gripper[:, [0, 2]].T
        by_bends = np.tile(in_plane.transpose(1, 2, 0), (len(self._across), 1, 1))
        if len(theta) == self.segments:
            return SparseJacobian.from_dense(by_bends)
        arms = self.deform(theta[None]).vertices[0].T - gripper[:, 3]
        turning = pose.rotated_points_jacobian(theta[self.segments : self.segments + 3], arms)
        shifting = np.broadcast_to(np.eye(3), turning.shape)
        return SparseJacobian.from_dense(np.concatenate([by_bends, turning, shifting], axis=2))

    def _column_derivatives(self, bends: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Derivatives (segments, columns) of the columns' coordinates along the gripper's x (real) and z (imaginary).

        A bend changes the arc of its own segment and rotates the following ones.
        """
        shares = np.clip(self._along / self._step - np.arange(self.segments)[:, None], 0, 1)
        starts = self._step * np.exp(1j * (np.cumsum(bends) - bends))[:, None] * shares
        end, derivative = arc(bends[:, None] * shares)
        passed = np.cumsum(starts * end, axis=0)
        return starts * shares * derivative + 1j * (passed[-1] - passed)

    def inclination(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Downward inclination of the strip from the horizontal at the ends of the segments, (segments + 1,) [rad].

        Measured in the plane of bending, independent of the other motion of the gripper.
        """
        down = self.T_rg(theta)[:3, :3].T @ self._down
        start = np.arctan2(down[0], abs(down[2]))
        return start + np.copysign(1.0, down[2]) * np.concatenate([[0.0], np.cumsum(theta[: self.segments])])

    def side_view(self, theta: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rig points (n, 3) as horizontal distance from the gripper and drop below it (n, 2) [m]."""
        T_rg = self.T_rg(theta)
        ahead = T_rg[:3, 0] - (T_rg[:3, 0] @ self._down) * self._down
        axes = np.stack([ahead / max(np.linalg.norm(ahead), 1e-9), self._down], axis=1)
        return (points - T_rg[:3, 3]) @ axes

    def T_rg(self, theta: NDArray[np.float64]) -> Pose:
        """Pose of the gripper line: x along the strip's tangent at the gripper, y along the line."""
        return np.vstack([self._gripper(theta[None])[0], [0.0, 0.0, 0.0, 1.0]])

    def _gripper(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Poses (population, 3, 4) of the gripper line in the rig."""
        motion = thetas[:, self.segments :]
        if not motion.shape[1]:
            return np.tile(self._T_rg[:3], (len(thetas), 1, 1))
        turns = scipy.spatial.transform.Rotation.from_rotvec(motion[:, :3]).as_matrix() @ self._T_rg[:3, :3]
        return np.concatenate([turns, (self._T_rg[:3, 3] + motion[:, 3:])[:, :, None]], axis=2)


@kernel
def _deform(
    bends: NDArray[np.float64],
    step: float,
    gripper: NDArray[np.float64],
    along: NDArray[np.float64],
    across: NDArray[np.float32],
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
) -> None:
    """Eq. 9 for a population: concatenated arcs, extruded sideways.

    The chord of an arc of length s and angle a has length s · sin(a/2)/(a/2) and is rotated by a/2: eq. 9 without its
    radius, which is infinite for a straight segment.

    Args:
        bends: angles of the segments (population, k) [rad].
        step: length of a segment [m].
        gripper: poses of the gripper line in the rig (population, 3, 4).
        along: arc length of the mesh's columns (columns,) [m], ascending.
        across: coordinate of its rows along the gripper line (rows,) [m].
        vertices, normals: results (population, 3, rows · columns).
    """
    columns, last = along.size, bends.shape[1] - 1
    for k in prange(bends.shape[0]):
        line = np.empty((6, columns), np.float32)
        x, z, phi, segment = 0.0, 0.0, 0.0, 0  # start of the segment
        for c in range(columns):
            while segment < last and along[c] > (segment + 1) * step:
                half = 0.5 * bends[k, segment]
                chord = step * (np.sin(half) / half if abs(half) > 1e-4 else 1 - half * half / 6)
                x, z = x + chord * np.cos(phi + half), z + chord * np.sin(phi + half)
                phi += bends[k, segment]
                segment += 1
            s = along[c] - segment * step
            half = 0.5 * bends[k, segment] * s / step
            chord = s * (np.sin(half) / half if abs(half) > 1e-4 else 1 - half * half / 6)
            p, q = x + chord * np.cos(phi + half), z + chord * np.sin(phi + half)
            u, w = -np.sin(phi + 2 * half), np.cos(phi + 2 * half)
            for i in range(3):
                line[i, c] = gripper[k, i, 0] * p + gripper[k, i, 2] * q + gripper[k, i, 3]
                line[3 + i, c] = gripper[k, i, 0] * u + gripper[k, i, 2] * w
        for i in range(3):
            for r in range(across.size):
                shift = np.float32(gripper[k, i, 1] * across[r])
                for c in range(columns):
                    vertices[k, i, r * columns + c] = line[i, c] + shift
                    normals[k, i, r * columns + c] = line[3 + i, c]
