"""Which shots of a board are worth keeping, and when there are enough of them."""

from collections.abc import Mapping, Sequence

from abs_service.calibration.shots.corner_extraction import Seen
from calib.board import coverage
from calib.board.corners.errors import MovedError
from calib.board.coverage import MissingView
from calib.board.mirrored import MirroredSensorError
from calib.views import CornerView


class Collector:
    """Keeps shots that show something new.

    Args:
        sizes: width and height of the images of every sensor that has any [px], by sensor name.

    Attributes:
        views: kept views of all sensors.
        kept: number of shots.
        latest: what became of the last shot, by sensor; "" for a sensor whose view was kept.
    """

    def __init__(self, sizes: Mapping[str, tuple[int, int]]) -> None:
        self.sizes = sizes
        self.views: list[CornerView] = []
        self.kept = 0
        self.latest: dict[str, str] = {}

    @property
    def missing_views(self) -> Sequence[MissingView]:
        """What is missing, the most important first; empty when there is enough."""
        return coverage.missing_views(self.views, self.sizes)

    def take(self, seen: Seen) -> bool:
        """Keeps what one shot showed if it adds something, and tells whether it did.

        A shot with a sensor before which the board moved is never kept: the others may have seen it elsewhere.
        """
        self.latest = {sensor: str(error) for (_, sensor), error in seen.refused.items()}
        moved = any(isinstance(error, MovedError) for error in seen.refused.values())
        new = {
            view.sensor: coverage.adds_information(view, self.views, self.sizes[view.sensor]) for view in seen.corners
        }
        is_kept = any(new.values()) and not moved
        for view in seen.corners:
            self.latest[view.sensor] = "" if is_kept else "nothing new: change the pose"
        if is_kept:
            self.views += seen.corners
            self.kept += 1
        return is_kept

    def problem(self) -> str:
        """Why the kept views are of no use for a calibration; "" if they are."""
        missing = [sensor for sensor in self.sizes if not any(view.sensor == sensor for view in self.views)]
        try:
            coverage.check(self.views)
        except (coverage.TooFewViewsError, coverage.ViewsAlikeError, MirroredSensorError) as error:
            return str(error)
        return f"{missing[0]} has not seen the board" if missing else ""
