"""A rig file in a program: its cameras, its noise models and its trackers."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from abs_service import config, wiring
from abs_service.api import checks
from abs_service.api.checks import ArgumentError
from abs_service.api.tracker import Tracker
from calib.camera import Camera

_NONE: Mapping[str, Camera] = MappingProxyType({})


class Rig:
    """A rig file; `load_rig` reads one, `Recording.rig` is that of a recording.

    Args:
        settings: the configuration.
        cameras: cameras of the sensors as their devices know them; what the file says takes their place.

    Attributes:
        name: of the rig.
        sensors, trackers: names.
        cameras: by sensor: those that the file or `cameras` describes. Others are known when their device is opened.
        noise: noise model of every sensor that has one, by sensor.
    """

    def __init__(self, settings: config.ServiceConfig, cameras: Mapping[str, Camera] = _NONE):
        self._settings = settings
        self.name = settings.name
        self.sensors = tuple(settings.sensors)
        self.trackers = tuple(settings.trackers)
        self.cameras: Mapping[str, Camera] = wiring.cameras(settings, cameras)
        self.noise: Mapping[str, Any] = {
            name: table.noise for name, table in settings.sensors.items() if table.noise is not None
        }

    def tracker(
        self,
        name: str = "",
        *,
        cameras: Mapping[str, Camera] = _NONE,
        geometry: Literal["z", "radial"] = "z",
        bayer: Literal["rggb", "bggr", "grbg", "gbrg"] = "rggb",
        budget_ms: float | None = None,
    ) -> Tracker:
        """A new tracker as the file describes it.

        Args:
            name: which one; "" if there is only one.
            cameras: by sensor, where the file leaves them to the devices: `recording.cameras`, for example.
            geometry, bayer, budget_ms: as for `Tracker`; the time in the file is for live tracking only.

        Raises:
            ArgumentError: no such tracker, or several; a sensor without a camera.
        """
        given = checks.mapping("cameras", cameras, '{"tof": Camera(…)}')
        given = {sensor: checks.camera(f"cameras[{sensor!r}]", camera) for sensor, camera in given.items()}
        if name == "" and len(self.trackers) == 1:
            name = self.trackers[0]
        if name not in self.trackers:
            raise ArgumentError(f"name = {name!r}: the rig has {', '.join(self.trackers) or 'no trackers'}")
        known = wiring.cameras(self._settings, {**self.cameras, **given})
        for sensor in self._settings.trackers[name].sensors:
            if sensor not in known:
                raise ArgumentError(
                    f'cameras: sensor "{sensor}" of tracker "{name}" has no camera in the rig file; '
                    f'pass cameras={{"{sensor}": Camera(…)}}'
                )
        return Tracker.configured(self._settings, name, known, geometry, bayer, budget_ms)


def load_rig(path: str | Path) -> Rig:
    """Reads a rig file; no device is opened.

    Raises:
        ArgumentError: no path.
        ConfigError: names file, key, value and the allowed values, for all that is wrong with it.
    """
    return Rig(config.load(checks.path(path)))
