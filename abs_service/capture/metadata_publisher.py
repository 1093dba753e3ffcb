"""Publishes what a rig's sensors are: configuration, calibrations, noise models and poses."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from google.protobuf.message import Message

from abs_service.bus import keys
from abs_service.bus.contract import Bus, Publisher
from abs_service.bus.stamps import HeaderFactory
from abs_service.capture import sensor_metadata
from calib.camera import Camera


@dataclass(frozen=True)
class ConfiguredSensors:
    """Sensors as a configuration describes them."""

    toml: str
    noises: Mapping[str, Mapping[str, Any]]


class MetadataPublisher:
    """Publishes the configuration, and calibration, noise model and pose of every sensor whose device is open.

    Its methods may be called from any thread: devices are opened by threads of their own.
    """

    def __init__(self, bus: Bus, headers: HeaderFactory, described: ConfiguredSensors) -> None:
        self._bus = bus
        self._headers = headers
        self._described = described
        self._cameras: dict[str, Camera] = {}
        self._publishers: dict[str, Publisher] = {}
        self._seq = 0
        self._lock = threading.Lock()

    def configure(self, described: ConfiguredSensors) -> None:
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
            self._put(keys.CONFIG, sensor_metadata.config(header, self._described.toml))
            wall_ns = header.stamp.ToNanoseconds()
            cameras = sensor_metadata.of_cameras(header, self._cameras, self._described.noises, wall_ns)
            for topic, message in cameras.items():
                self._put(topic, message)

    def _put(self, topic: str, message: Message) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self._bus.latched_publisher(topic, message.DESCRIPTOR.full_name)
        self._publishers[topic].put(message.SerializeToString())
