"""Views of a board that a stored calibration is verified with, and what is not used of them."""

from collections import Counter
from dataclasses import replace

import numpy as np

from abs_service.calibration.files.rig_file import RigCalibration
from abs_service.calibration.shots import unseen
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.report.content import Level, Verdict
from calib.board.distinct import distinct_poses
from calib.board.views import PlaneView
from calib.calibration_check.stored_calibration import Stored, Views
from calib.solve.bundle.parameters.state import SensorState

#: Maximum number of shots, each of another pose of the board.
MAX_SHOTS = 40

#: Maximum number of distances per view; errors of neighbours are correlated, so more add little.
MAX_DISTANCES = 300


def stored_in(known: RigCalibration) -> Stored:
    """Cameras, depth terms and covariances of a calibration file."""
    sensors = {
        name: SensorState(one.camera, one.depth_offset, one.depth_scale, one.time_offset)
        for name, one in known.sensors.items()
    }
    covariance = known.covariance
    return Stored(sensors, covariance.names, covariance.matrix if covariance.names else None)


def of_known_sensors(seen: BoardObservations, stored: Stored) -> Views:
    """Views of the sensors that are stored."""
    return Views(seen.corners, seen.planes).of(stored.sensors, {view.shot for view in (*seen.corners, *seen.planes)})


def thinned(views: Views) -> Views:
    """Views of a limited number of evenly spread shots: of each distinct pose the one that most sensors saw."""
    poses = distinct_poses(views.corners)
    seen = Counter(view.shot for view in views.corners)
    best = {poses[shot]: shot for shot in sorted(seen, key=lambda shot: seen[shot])}
    shots = sorted(best.values())
    kept = {shots[index] for index in np.linspace(0, len(shots) - 1, min(MAX_SHOTS, len(shots))).round().astype(int)}
    fewer = views.of(views.shots, kept)
    return Views(fewer.corners, [_sparse(view) for view in fewer.planes])


def _sparse(view: PlaneView) -> PlaneView:
    every = max(1, len(view.pixels) // MAX_DISTANCES)
    parts = {part: getattr(view, part)[::every] for part in ("pixels", "distances", "sigmas")}
    return replace(view, **parts)


def verdicts(known: RigCalibration, seen: BoardObservations, used: Views) -> list[Verdict]:
    """Verdicts on views of the calibration itself, on sensors without any, and on views that no camera could have."""
    found = _of_the_calibration(known, seen)
    for name in known.sensors:
        corners = {view.shot for view in seen.corners if view.sensor == name}
        lost = sorted(corners - {view.shot for view in used.corners if view.sensor == name})
        if lost:
            text = (
                f"{len(lost)} of {len(corners)} images show a board where its stored camera could not have seen one "
                f"(shots {', '.join(map(str, lost))}); they were left out."
            )
            found.append(
                Verdict(Level.DOUBTFUL, text, "Look at these images, and whether they are of this camera.", name)
            )
        elif name not in used.shots:
            why = unseen.reasons(_rejected_of(seen, name))
            text = f"did not see the board{f' ({why})' if why else ''}, so nothing can be said of it."
            found.append(Verdict(Level.DOUBTFUL, text, "Show it the board too.", name))
    return found


def _of_the_calibration(known: RigCalibration, seen: BoardObservations) -> list[Verdict]:
    own = sum(view.digest in known.covariance.views for view in seen.corners)
    if 2 * own <= len(seen.corners):
        return []
    text = (
        f"{own} of {len(seen.corners)} images are those that it was made from: it fits these in any case, and they do "
        "not show whether it still holds."
    )
    return [Verdict(Level.DOUBTFUL, text, "Take new images of the board.")]


def _rejected_of(seen: BoardObservations, sensor: str) -> list[Exception]:
    return [error for (_, name), error in seen.rejected.items() if name == sensor]
