"""Calibration task: sensors with prior knowledge, and their observations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from calib.board.distinct import distinct_poses
from calib.board.views import CornerView, PlaneView
from calib.camera import Camera
from calib.solve.bundle.parameters.layout import DEPTH_TERMS, FreeParameters
from calib.solve.bundle.parameters.lens_parameters import ASPECT, BROWN_CONRADY, MATRIX, LensKind


class TaskError(ValueError):
    """Invalid calibration task."""


@dataclass(frozen=True)
class SensorTask:
    """One optical head: known values and parameters to estimate.

    Attributes:
        width, height: of its images [px].
        lens: kind of lens to fit.
        factory: initial or fixed camera; empty if unknown, otherwise one.
        fixed_intrinsics: True if the intrinsics are fixed.
        fixed: single intrinsics that are, or `ASPECT` for the ratio of the focal lengths.
        fixed_pose: True if the pose in the rig is, as of a depth image that was aligned to another sensor's image.
        depth_terms: those of `DEPTH_TERMS` that are estimated.
        free_running: True if its clock has an unknown offset (free-running sensor).
    """

    width: int
    height: int
    lens: LensKind = BROWN_CONRADY
    factory: tuple[Camera, ...] = ()
    fixed_intrinsics: bool = False
    fixed_pose: bool = False
    depth_terms: tuple[str, ...] = ()
    free_running: bool = False
    fixed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if unknown := [name for name in self.fixed if name not in self.lens.fixable]:
            raise TaskError(f"{', '.join(unknown)}: can be fixed: {', '.join(self.lens.fixable)}")
        if (self.fixed_intrinsics or self.fixed_pose) and not self.factory:
            raise TaskError("intrinsics and poses can be kept only where a calibration to keep is given")
        unknown = set(self.depth_terms) - set(DEPTH_TERMS)
        if unknown:
            raise TaskError(f"depth terms must be of {', '.join(DEPTH_TERMS)}, not {', '.join(sorted(unknown))}")
        for camera in self.factory:
            if (camera.width, camera.height) != (self.width, self.height):
                raise TaskError(
                    f"a calibration for images of {camera.width} × {camera.height} pixels does not fit "
                    f"{self.width} × {self.height}"
                )

    def with_lens(self, lens: LensKind) -> "SensorTask":
        """The sensor with another kind of lens, on which what it does not have is not fixed."""
        return replace(self, lens=lens, fixed=tuple(name for name in self.fixed if name in lens.fixable))

    def free_parameters(self, moves: bool) -> FreeParameters:
        """Free parameters of the sensor."""
        held = {*self.fixed}
        ratio = ASPECT in held and not held & {"fx", "fy"}
        if ASPECT in held:  # one of two that are tied is no parameter, and fixes both if it is fixed
            held |= {"fy"} if ratio else {"fx", "fy"}
        intrinsics = () if self.fixed_intrinsics else (*MATRIX, *self.lens.coefficients)
        return FreeParameters(
            self.lens,
            tuple(name for name in intrinsics if name not in held),
            moves and not self.fixed_pose,
            self.depth_terms,
            self.free_running,
            ratio and not self.fixed_intrinsics,
        )


@dataclass(frozen=True)
class Task:
    """Complete calibration task.

    Attributes:
        sensors: by name.
        corners, planes: observations.
        reference: sensor with a fixed pose: the rig's frame, or its `factory` pose in the rig.
        maximum_gap: largest gap between two shots of one motion of the board [s]; for free-running sensors.
        min_views_fixed: minimum number of views of a sensor with fixed intrinsics.
        two_ways_up: True if the board looks the same upside down, so that sensors may number it from different ends.
    """

    sensors: Mapping[str, SensorTask]
    corners: Sequence[CornerView]
    planes: Sequence[PlaneView]
    reference: str
    maximum_gap: float = 0.5
    min_views_fixed: int = 3
    two_ways_up: bool = False

    def __post_init__(self) -> None:
        if self.reference not in self.sensors:
            raise TaskError(f'the reference "{self.reference}" must be one of {", ".join(self.sensors)}')
        strangers = {view.sensor for view in (*self.corners, *self.planes)} - set(self.sensors)
        if strangers:
            raise TaskError(f"views of {', '.join(sorted(strangers))}, which are no sensors of this calibration")
        if self.sensors[self.reference].free_running:
            raise TaskError(f'the reference "{self.reference}" keeps the time: another sensor has to run freely')
        fixed = [name for name, sensor in self.sensors.items() if sensor.fixed_pose]
        if fixed and not self.sensors[self.reference].factory:
            raise TaskError(f"{', '.join(fixed)}: poses can be kept only with one of the reference, {self.reference}")
        if not self.corners:
            raise TaskError("no view shows any corner of the board")

    @property
    def shots(self) -> list[int]:
        """Numbers of all shots, ascending."""
        return sorted({view.shot for view in (*self.corners, *self.planes)})

    @cached_property
    def poses(self) -> Mapping[int, int]:
        """Distinct board pose of every shot, named by its first shot; see `distinct_poses`."""
        sizes = {name: (sensor.width, sensor.height) for name, sensor in self.sensors.items()}
        return {shot: shot for shot in self.shots} | distinct_poses(self.corners, sizes)

    def of_shots(self, shots: Sequence[int]) -> "Task":
        """Task restricted to some shots."""
        wanted = set(shots)
        return replace(
            self,
            corners=[view for view in self.corners if view.shot in wanted],
            planes=[view for view in self.planes if view.shot in wanted],
        )
