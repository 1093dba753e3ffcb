"""Publishes what a rig's sensors are: configuration, calibrations, noise models and poses."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from abs_service.bus import keys
from abs_service.bus.contract import Bus, Publisher
from abs_service.bus.stamps import HeaderFactory
from abs_service.capture import sensor_metadata
from abs_service.wire.message_header import CALIBRATION, CONFIG, MODEL, TRANSFORMS
from calib.camera import Camera


@dataclass(frozen=True)
class Described:
    """Sensors as a configuration describes them."""

    toml: str
    noises: Mapping[str, Mapping[str, Any]]


class MetadataPublisher:
    """Publishes the configuration, and calibration, noise model and pose of every sensor whose device is open.

    Its methods may be called from any thread: devices are opened by threads of their own.
    """

    def __init__(self, bus: Bus, headers: HeaderFactory, described: Described) -> None:
        self._bus = bus
        self._headers = headers
        self._described = described
        self._cameras: dict[str, Camera] = {}
        self._publishers: dict[str, Publisher] = {}
        self._seq = 0
        self._lock = threading.Lock()

    def configure(self, described: Described) -> None:
        """Publishes another configuration from now on, with the same cameras."""
        with self._lock:
            self._described = described

    def add(self, cameras: Mapping[str, Camera]) -> None:
        """Adds cameras, by sensor, and publishes all metadata."""
        with self._lock:
            self._cameras |= cameras
        self.publish()

    def camera(self, sensor: str) -> Camera:
        """Camera of a sensor whose device was opened."""
        with self._lock:
            return self._cameras[sensor]

    def publish(self) -> None:
        """Publishes all metadata, stamped now."""
        with self._lock:
            header = self._headers.now(self._seq)
            self._seq += 1
            wall_ns = header.stamp.ToNanoseconds()
            toml = sensor_metadata.config(header, self._described.toml)
            self._put(keys.CONFIG, CONFIG, toml.SerializeToString())
            for sensor, camera in self._cameras.items():
                model = sensor_metadata.sensor_model(header, sensor, camera, self._described.noises[sensor])
                calibration = sensor_metadata.calibration(sensor, camera, wall_ns)
                self._put(keys.model(sensor), MODEL, model.SerializeToString())
                self._put(keys.calibration(sensor), CALIBRATION, calibration.SerializeToString())
            if self._cameras:
                poses = sensor_metadata.transforms(self._cameras, wall_ns)
                self._put(keys.TRANSFORMS, TRANSFORMS, poses.SerializeToString())

    def _put(self, topic: str, message: str, payload: bytes) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self._bus.latched_publisher(topic, message)
        self._publishers[topic].put(payload)
