"""What a calibration is asked: the sensors with what is known of them, and what they saw."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from calib.camera import Camera
from calib.solve.bundle.layout import DEPTH_TERMS, Freedom
from calib.solve.bundle.lens_parameters import BROWN_CONRADY, MATRIX, LensKind
from calib.views import CornerView, PlaneView


class TaskError(ValueError):
    """A calibration that cannot be asked for."""


@dataclass(frozen=True)
class SensorTask:
    """One optical head: what is known of it and what is wanted.

    Attributes:
        width, height: of its images [px].
        lens: kind of lens to fit.
        factory: cameras to start from, or to keep; empty if nothing is known, otherwise one.
        keeps_intrinsics: whether the intrinsics are known and stay as they are.
        depth_terms: those of `DEPTH_TERMS` that are fitted.
        runs_free: whether its clock has an unknown offset to the others'.
    """

    width: int
    height: int
    lens: LensKind = BROWN_CONRADY
    factory: tuple[Camera, ...] = ()
    keeps_intrinsics: bool = False
    depth_terms: tuple[str, ...] = ()
    runs_free: bool = False

    def __post_init__(self) -> None:
        if self.keeps_intrinsics and not self.factory:
            raise TaskError("intrinsics can be kept only where a calibration to keep is given")
        unknown = set(self.depth_terms) - set(DEPTH_TERMS)
        if unknown:
            raise TaskError(f"depth terms must be of {', '.join(DEPTH_TERMS)}, not {', '.join(sorted(unknown))}")
        for camera in self.factory:
            if (camera.width, camera.height) != (self.width, self.height):
                raise TaskError(
                    f"a calibration for images of {camera.width} × {camera.height} pixels does not fit "
                    f"{self.width} × {self.height}"
                )

    def freedom(self, moves: bool) -> Freedom:
        """What the solve is free to change."""
        intrinsics = () if self.keeps_intrinsics else (*MATRIX, *self.lens.coefficients)
        return Freedom(self.lens, intrinsics, moves, self.depth_terms, self.runs_free)


@dataclass(frozen=True)
class Task:
    """A whole calibration.

    Attributes:
        sensors: by name.
        corners, planes: what they saw.
        reference: sensor whose pose in the rig is not free: the rig's frame, or fixed in it by its `factory` pose.
        longest_gap: between two shots of one motion of the board [s]; for sensors that run freely.
        least_kept: fewest views of a sensor whose intrinsics are kept.
    """

    sensors: Mapping[str, SensorTask]
    corners: Sequence[CornerView]
    planes: Sequence[PlaneView]
    reference: str
    longest_gap: float = 0.5
    least_kept: int = 3

    def __post_init__(self) -> None:
        if self.reference not in self.sensors:
            raise TaskError(f'the reference "{self.reference}" must be one of {", ".join(self.sensors)}')
        strangers = {view.sensor for view in (*self.corners, *self.planes)} - set(self.sensors)
        if strangers:
            raise TaskError(f"views of {', '.join(sorted(strangers))}, which are no sensors of this calibration")
        if self.sensors[self.reference].runs_free:
            raise TaskError(f'the reference "{self.reference}" keeps the time: another sensor has to run freely')
        if not self.corners:
            raise TaskError("no view shows any corner of the board")

    @property
    def shots(self) -> list[int]:
        """Numbers of all shots, ascending."""
        return sorted({view.shot for view in (*self.corners, *self.planes)})

    def of_shots(self, shots: Sequence[int]) -> "Task":
        """The same with the views of some shots only."""
        wanted = set(shots)
        return replace(
            self,
            corners=[view for view in self.corners if view.shot in wanted],
            planes=[view for view in self.planes if view.shot in wanted],
        )
