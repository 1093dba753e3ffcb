"""Images of most shots that were not taken at the same moment: each fits alone, and together they do not."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.solve.rounding import rounded
from calib.solve.solution import Solution
from calib.solve.start.board_poses import pose_candidates
from calib.solve.start.start import fit_camera

#: Images of a shot that fit this many times better alone are of different moments. If they miss by this much together,
#: that is an objection of its own; by less, it may be why the shots disagree.
_BETTER, SCATTERS_PX = 3.0, 0.5


@dataclass(frozen=True)
class Scatter:
    """Images that fit alone and not together, in most shots.

    Attributes:
        sensors: that saw the board together.
        apart_px: median over the shots of the worse view's residual, with one board in each shot [px].
        alone_px: median residual of a view, with a camera and boards of its own [px].
    """

    sensors: tuple[str, ...]
    apart_px: float
    alone_px: float

    def __str__(self) -> str:
        """The finding, and what to do."""
        return (
            f"{' and '.join(self.sensors)}: each fits its own corners to {rounded(self.alone_px)} px, but together "
            f"they miss by {rounded(self.apart_px)} px in most shots: the images of a shot were not taken at the same "
            "moment, or a sensor was moved or zoomed between them; hold the board still in every shot, "
            "or synchronise the sensors"
        )


def scatter(solution: Solution, minimum_px: float = SCATTERS_PX) -> list[Scatter]:
    """Evidence that images of most shots were taken at different moments: empty, or one `Scatter`.

    Args:
        solution: from all shots.
        minimum_px: what they miss by together, to be named [px].
    """
    together = [shot for shot in solution.task.shots if len(_seeing(solution, shot)) > 1]
    corners = [view for view in solution.views if view.of == "corners" and view.shot in together]
    worst = [max(view.rms for view in corners if view.shot == shot) for shot in together]
    joint = float(np.median(worst)) if worst else 0.0
    if not worst or joint < minimum_px:
        return []
    alone = [fitted for name in solution.task.sensors for fitted in _alone(solution, name, together)]
    if not alone or joint < _BETTER * float(np.median(alone)):
        return []
    return [Scatter(tuple(dict.fromkeys(view.sensor for view in corners)), joint, float(np.median(alone)))]


def typical_alone(solution: Solution) -> float:
    """Median over all views of what corners miss by with a camera and boards of each sensor's own [px]."""
    shots = solution.task.shots
    return float(np.median([each for name in solution.task.sensors for each in _alone(solution, name, shots)]))


def _seeing(solution: Solution, shot: int) -> list[str]:
    return [view.sensor for view in solution.task.corners if view.shot == shot]


def _alone(solution: Solution, name: str, shots: Sequence[int]) -> list[float]:
    """Residuals of a sensor's views [px] with a camera and boards of its own."""
    views = [view for view in solution.task.corners if view.sensor == name]
    if not views:
        return []
    sensor, camera = solution.task.sensors[name], solution.cameras[name]
    if not sensor.fixed_intrinsics:
        camera = fit_camera(name, sensor, views, camera)
    return [found[0].rms_px for view in views if view.shot in shots and (found := pose_candidates(camera, view))]
