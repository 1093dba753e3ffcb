"""Corner and plane extraction from shots, with reasons for rejected images."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from abs_service.calibration.shots.shots import SensorShot, Shot
from calib.board import plane
from calib.board.corners import detection, errors, quality, stillness
from calib.board.corners.detection import Detection
from calib.board.corners.errors import BoardError
from calib.board.corners.to_8bit import grey
from calib.board.target import Target
from calib.board.views import CornerView, PlaneView
from calib.camera import Camera

#: Tolerance of the predicted board position in a sensor without image, by prior cameras [px].
_SLACK_PX = 8.0


@dataclass(frozen=True, slots=True)
class BoardObservations:
    """Observations of a board in some shots.

    Attributes:
        corners: views of its points.
        planes: distances on it.
        rejected: errors of rejected images, by (shot, sensor).
        sizes: width and height of each sensor's images [px], by sensor name.
    """

    corners: tuple[CornerView, ...] = ()
    planes: tuple[PlaneView, ...] = ()
    rejected: Mapping[tuple[int, str], BoardError] = field(default_factory=dict)
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    def __add__(self, other: "BoardObservations") -> "BoardObservations":
        return BoardObservations(
            self.corners + other.corners,
            self.planes + other.planes,
            {**self.rejected, **other.rejected},
            {**self.sizes, **other.sizes},
        )

    def of_shots(self, shots: Collection[int]) -> "BoardObservations":
        """Observations in some shots."""
        return BoardObservations(
            tuple(view for view in self.corners if view.shot in shots),
            tuple(view for view in self.planes if view.shot in shots),
            {key: error for key, error in self.rejected.items() if key[0] in shots},
            self.sizes,
        )


def see(target: Target, shot: Shot, cameras: Mapping[str, Camera]) -> BoardObservations:
    """Observations of a board in one shot.

    Corners come from a sensor's image, and distances from within their hull. For a sensor that measures distances only,
    the region is predicted from the pose of the board in another sensor and the `cameras` known so far; without them
    such a sensor is left out.
    """
    corners: list[CornerView] = []
    planes: list[PlaneView] = []
    rejected: dict[tuple[int, str], BoardError] = {}
    sizes: dict[str, tuple[int, int]] = {}
    for sensor, look in shot.sensor_shots.items():
        if not look.image.size:
            continue
        sizes[sensor] = (look.image.shape[1], look.image.shape[0])
        try:
            found = _find(target, look)
        except BoardError as error:
            rejected[shot.number, sensor] = error
            continue
        view = found.view(target, sensor, shot.number, look.t_ns * 1e-9)
        corners.append(view)
        planes += _plane(view, look)
    for sensor, look in shot.sensor_shots.items():
        if not look.image.size and look.distance.size:
            sizes[sensor] = (look.distance.shape[1], look.distance.shape[0])
            planes += _hidden_plane(target, sensor, shot, corners, cameras)
    return BoardObservations(tuple(corners), tuple(planes), rejected, sizes)


def _find(target: Target, look: SensorShot) -> Detection:
    largest = detection.MAX_SATURATED_ACTIVE if look.own_light else detection.MAX_SATURATED
    found = detection.detect(target, look.image, largest)
    if look.before is not look.image and look.before.shape == look.image.shape:
        change = stillness.changed_fraction(grey(look.before), grey(look.image), found.pixels)
        if change > stillness.MAX_CHANGED_FRACTION:
            raise errors.MovedError("the board moved since the image before. Hold it still for a moment")
    return found


def _plane(view: CornerView, look: SensorShot) -> list[PlaneView]:
    if look.distance.shape != look.image.shape[:2]:
        return []
    inside = plane.white_pixels(look.image, plane.region(view.pixels, look.distance.shape))
    inside = inside & ~quality.is_saturated(look.image)
    found = plane.plane_view(view.sensor, view.shot, view.t_s, inside, look.distance, look.sigma)
    return [] if found is None else [found]


def _hidden_plane(
    target: Target, sensor: str, shot: Shot, corners: list[CornerView], cameras: Mapping[str, Camera]
) -> list[PlaneView]:
    candidates = [view for view in corners if view.sensor in cameras]
    if sensor not in cameras or not candidates:
        return []
    best = max(candidates, key=lambda view: len(view.points_b))
    T_rb = plane.board_pose(best, cameras[best.sensor])
    if T_rb is None:
        return []
    look = shot.sensor_shots[sensor]
    inside = plane.projected_region(target, T_rb, cameras[sensor], _SLACK_PX)
    found = plane.plane_view(sensor, shot.number, look.t_ns * 1e-9, inside, look.distance, look.sigma)
    return [] if found is None else [found]
