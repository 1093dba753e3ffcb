"""An object that comes into view over the image's border gets no mesh before it has come."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection, UndecidedError
from abs_service.tracker.estimates.estimate import Status
from abs_service.tracking.monitors.arrival_monitor import ArrivalMonitor
from abs_service.tracking.session import TrackingSession
from calib.camera import Camera
from drivers.contract.frame import Frame
from tests.abs_service.tracking.driving import default_plan, drive, rig_of, simulate

CAMERA = Camera(160, 120, fx=140, fy=140, cx=80, cy=60)
#: Time from image to image [ns].
IMAGE_NS = 33_000_000


def detection(columns: int, first: int = 0) -> InitialDetection:
    """A thing of so many columns before a wall."""
    wall, thing = np.full((120, 160), 1.2, np.float32), np.full((120, 160), np.nan, np.float32)
    thing[40:80, first : first + columns] = 0.8
    return InitialDetection(thing, CAMERA, 200, np.fmin(wall, thing))


def nothing() -> InitialDetection:
    raise DetectionError("nothing there")


def taken(widths: list[int], first: int = 0) -> list[bool]:
    """True for each image in which a thing of so many columns is taken, after one without it."""
    monitor, result = ArrivalMonitor(), []
    with pytest.raises(DetectionError):
        monitor.checked(nothing, 0)
    for k, width in enumerate(widths):
        try:
            monitor.checked(lambda width=width: detection(width, first), (k + 1) * IMAGE_NS)
            result.append(True)
        except UndecidedError:
            result.append(False)
    return result


def test_what_comes_in_over_the_border_is_taken_when_it_has_come():
    growing, arrived = [5 + 3 * k for k in range(20)], [62] * 15
    got = taken(growing + arrived)
    assert not any(got[:20])
    assert got.index(True) in range(27, 31)  # 0.3 s after
    assert all(got[30:])


def test_what_appears_inside_the_image_is_taken_at_once():
    assert all(taken([20, 40, 60], first=40))


def test_the_first_image_is_taken_as_it_is_and_so_is_one_long_after_the_last():
    monitor = ArrivalMonitor()
    assert monitor.checked(lambda: detection(20), 0)
    assert monitor.checked(lambda: detection(60), 2_000_000_000)


def entering(k: int, frames: list[Frame]) -> list[Frame]:
    """All images shifted to the right by less and less; to the left, the background goes on."""
    return [replace(frame, data=shifted(frame.data, max(0.0, 0.66 - 0.033 * k))) for frame in frames]


def shifted(image: np.ndarray, share: float) -> np.ndarray:
    """An image whose content lies farther to the right, by a share of its width."""
    columns = np.maximum(np.arange(image.shape[1]) - round(share * image.shape[1]), 0)
    return image[:, columns].copy()


def test_a_sheet_that_comes_into_view_gets_a_mesh_of_all_of_it():
    simulation = simulate("simulated://sheet?seed=3")
    whole, tracking = (TrackingSession(rig_of(simulation), default_plan()) for _ in range(2))
    next(drive(whole, simulation, range(1)))
    estimates = [step.estimate for step in drive(tracking, simulation, range(40), entering)]
    came = next(k for k, estimate in enumerate(estimates) if estimate.status != Status.INITIALIZING)
    assert any("comes into view" in estimate.reasons[0] for estimate in estimates[:came])
    assert tracking.mesh is not None
    assert whole.mesh is not None
    assert tracking.mesh.area > 0.9 * whole.mesh.area
    assert tracking.mesh_version == 1
