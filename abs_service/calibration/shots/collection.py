"""Selection of shots of a board for a calibration."""

from collections.abc import Mapping, Sequence

from abs_service.calibration.shots.corner_extraction import BoardObservations
from calib.board import coverage
from calib.board.corners.errors import MovedError
from calib.board.coverage import MissingView
from calib.board.distinct import counts_of, distinct_poses
from calib.board.mirrored import MirroredSensorError
from calib.board.views import CornerView


class Collector:
    """Keeps shots that add information.

    Args:
        sizes: width and height of the images of every sensor that has any [px], by sensor name.

    Attributes:
        seen: observations of the kept shots.
        kept: number of shots.
        latest: rejection of the last shot by sensor; "" for a sensor whose view was kept.
    """

    def __init__(self, sizes: Mapping[str, tuple[int, int]]) -> None:
        self.sizes = sizes
        self.seen = BoardObservations(sizes=sizes)
        self.kept = 0
        self.latest: dict[str, str] = {}

    @property
    def views(self) -> Sequence[CornerView]:
        """Kept views of all sensors."""
        return self.seen.corners

    @property
    def missing_views(self) -> Sequence[MissingView]:
        """Missing views, the most important first; empty if sufficient."""
        return coverage.missing_views(self.views, self.sizes)

    @property
    def poses(self) -> dict[str, int]:
        """Number of distinct poses of the board that each sensor has seen."""
        counts = counts_of(self.views, distinct_poses(self.views, self.sizes))
        return {sensor: counts.get(sensor, 0) for sensor in self.sizes}

    def take(self, seen: BoardObservations) -> bool:
        """Keeps a shot if it adds information; returns True if kept.

        A shot is rejected if the board moved in front of any sensor, because the others may have seen it elsewhere.
        """
        self.latest = {sensor: str(error) for (_, sensor), error in seen.rejected.items()}
        moved = any(isinstance(error, MovedError) for error in seen.rejected.values())
        new = {
            view.sensor: coverage.adds_information(view, self.views, self.sizes[view.sensor]) for view in seen.corners
        }
        is_kept = any(new.values()) and not moved
        for view in seen.corners:
            self.latest[view.sensor] = "" if is_kept else "nothing new: change the pose"
        if is_kept:
            self.seen += seen
            self.kept += 1
        return is_kept

    def problem(self) -> str:
        """Reason why the kept views do not allow a calibration; "" if they do."""
        missing = [sensor for sensor in self.sizes if not any(view.sensor == sensor for view in self.views)]
        try:
            coverage.check(self.views)
        except (
            coverage.SameImagesError,
            coverage.TooFewViewsError,
            coverage.ViewsAlikeError,
            MirroredSensorError,
        ) as error:
            return str(error)
        return f"{missing[0]} has not seen the board" if missing else ""
