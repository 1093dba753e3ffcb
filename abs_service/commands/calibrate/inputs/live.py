"""Live devices of a rig file as a source of views, as an alternative to a recording."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from abs_service import config
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.calibration.shots.live_shots import LiveShots
from abs_service.commands.calibrate.capture import opened
from calib.board import coverage
from calib.board.distinct import distinct_poses
from calib.camera import Camera


def is_live(source: Path | None) -> bool:
    """True if a source is a rig with live devices, false for a recording."""
    return source is not None and source.suffix == ".toml"


@contextmanager
def streaming(
    path: Path, cameras: Mapping[str, Camera], is_over: Callable[[], bool] = lambda: False
) -> Iterator[tuple[LiveShots, Mapping[str, Camera]]]:
    """Shots of the devices of a rig file while they stream, and the camera of each sensor.

    Args:
        path: of the rig file.
        cameras: replacements for the cameras of devices and rig file, by sensor name.
        is_over: polled; True ends the iteration.

    Raises:
        ConfigError: invalid rig file.
        DeviceError, HeadError, SettingError: a device cannot be opened, or lacks a head or a control.
        ShotsError: no sensor has images that can show a board.
    """
    rig = config.load(path)
    with opened(rig, path) as (devices, given):
        known = {name: cameras.get(name, camera) for name, camera in given.items()}
        tolerance_ns = round(rig.synchronisation.tolerance_ms * 1e6)
        with LiveShots(devices, known, tolerance_ns, time.monotonic_ns, is_over) as shots:
            yield shots, known


def adds(new: BoardObservations, seen: BoardObservations) -> bool:
    """True if a shot adds a view unlike all previous ones for some sensor; repeated views add no information."""
    return any(coverage.adds_information(view, seen.corners, new.sizes[view.sensor]) for view in new.corners)


def views(seen: BoardObservations) -> int:
    """Number of distinct poses of the board that some sensor saw."""
    return len(set(distinct_poses(seen.corners, seen.sizes).values()))
