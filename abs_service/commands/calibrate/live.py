"""The running devices of a rig file as a source of views of a board, where a recording would do as well."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from abs_service import config
from abs_service.calibration.shots.corner_extraction import Seen
from abs_service.calibration.shots.live_shots import LiveShots
from abs_service.commands.calibrate.capture import opened
from calib.board import coverage
from calib.camera import Camera


def is_live(source: Path | None) -> bool:
    """Whether a source is a rig whose devices are to be looked through, and no recording."""
    return source is not None and source.suffix == ".toml"


@contextmanager
def streaming(
    path: Path, cameras: Mapping[str, Camera], is_over: Callable[[], bool] = lambda: False
) -> Iterator[tuple[LiveShots, Mapping[str, Camera]]]:
    """Shots of the devices that a rig file describes, while they stream, and the camera of each of its sensors.

    Args:
        path: of the rig file.
        cameras: cameras in place of those that the devices and the rig file tell, by sensor name.
        is_over: whether to end now; asked again and again.

    Raises:
        ConfigError: the rig file cannot be used.
        DeviceError, HeadError, SettingError: a device cannot be opened, or lacks a head or a control.
        ShotsError: no sensor makes images in which a board can be seen.
    """
    rig = config.load(path)
    with opened(rig, path) as (devices, given):
        known = {name: cameras.get(name, camera) for name, camera in given.items()}
        tolerance_ns = round(rig.synchronisation.tolerance_ms * 1e6)
        with LiveShots(devices, known, tolerance_ns, time.monotonic_ns, is_over) as shots:
            yield shots, known


def adds(new: Seen, seen: Seen) -> bool:
    """Whether a shot shows some sensor a view that is unlike all before: a board that is held says nothing twice."""
    return any(coverage.adds_information(view, seen.corners, new.sizes[view.sensor]) for view in new.corners)


def views(seen: Seen) -> int:
    """Number of shots that showed the board to some sensor."""
    return len({view.shot for view in seen.corners})
