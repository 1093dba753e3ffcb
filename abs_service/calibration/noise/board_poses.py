"""Board pose relative to a depth sensor during a static sequence."""

from abs_service.calibration.shots.corner_extraction import see
from abs_service.calibration.shots.sequences import Sequence, SequenceError
from abs_service.calibration.shots.shots import Shot
from calib.board.target import Target
from calib.sequences.static_board import StaticBoard, locate


def static_board(target: Target, sequence: Sequence) -> StaticBoard:
    """Board pose from the depth sensor's own image, or else from the sensor with the most corners.

    Raises:
        SequenceError: no sensor detects the board; names the reason for each.
        NoiseError: the detected board is not in front of the depth sensor.
    """
    sensor_shots = {sensor: look for sensor, look in sequence.sensor_shots.items() if sensor in sequence.cameras}
    if not sensor_shots:
        raise SequenceError(
            f"{sequence.name}: there is no image of a sensor with a known camera in which the board could be seen"
        )
    seen = see(target, Shot(0, sensor_shots), sequence.cameras)
    views = {view.sensor: view for view in seen.corners}
    if not views:
        reasons = "; ".join(f"{sensor}: {error}" for (_, sensor), error in seen.rejected.items())
        raise SequenceError(f"{sequence.name}: {reasons}")
    best = max(views.values(), key=lambda view: (view.sensor == sequence.sensor, len(view.points_b)))
    return locate(best, sequence.cameras[best.sensor], sequence.camera)
