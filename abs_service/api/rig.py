"""A rig file in a program: its cameras, its noise models and its trackers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from abs_service import config, wiring
from abs_service.api import checks
from abs_service.api.checks import ArgumentError
from abs_service.api.tracker import Tracker, tracker_of
from abs_service.api.tracker_parts import tracker_parts
from calib.camera import Camera

_NONE: Mapping[str, Camera] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class Rig:
    """A rig file; `load_rig` reads one, `Recording.rig` is that of a recording.

    Attributes:
        name: of the rig.
        sensors, trackers: names.
        cameras: by sensor: those that the file or the recording has. Others are known when their device is opened.
        noise: noise model of every sensor that has one, by sensor.
    """

    name: str
    sensors: tuple[str, ...]
    trackers: tuple[str, ...]
    cameras: Mapping[str, Camera]
    noise: Mapping[str, Any]
    _settings: config.ServiceConfig = field(repr=False)

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
            raise ArgumentError(
                f"name = {name!r}: must be a tracker of the rig, {', '.join(self.trackers) or 'it has none'}"
            )
        known = wiring.cameras(self._settings, {**self.cameras, **given})
        for sensor in self._settings.trackers[name].sensors:
            if sensor not in known:
                raise ArgumentError(
                    f'cameras = {dict(given)}: must have one of "{sensor}", a sensor of tracker "{name}" that has '
                    f'none in the rig file: cameras={{"{sensor}": Camera(…)}}'
                )
        return tracker_of(tracker_parts(self._settings, name, known, geometry, bayer, budget_ms))


def load_rig(path: str | Path) -> Rig:
    """Reads a rig file; no device is opened.

    Raises:
        ArgumentError: no path.
        ConfigError: names file, key, value and the allowed values, for all that is wrong with it.
    """
    return configured_rig(config.load(checks.path(path)))


def configured_rig(settings: config.ServiceConfig, cameras: Mapping[str, Camera] = _NONE) -> Rig:
    """The rig of a configuration.

    Args:
        settings: the configuration.
        cameras: cameras of the sensors as their devices know them; what the configuration says takes their place.
    """
    noise = {name: table.noise for name, table in settings.sensors.items() if table.noise is not None}
    known = wiring.cameras(settings, cameras)
    return Rig(settings.name, tuple(settings.sensors), tuple(settings.trackers), known, noise, settings)
