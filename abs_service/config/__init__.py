"""The configuration of a rig: TOML on disk, checked and frozen in memory.

Only commands see these objects; everything behind them takes plain arguments.
"""

from abs_service.config.camera import CameraTable, PoseTable
from abs_service.config.loading import ConfigError, load, load_default, loads, to_toml
from abs_service.config.tables import (
    BusTable,
    DeviceTable,
    MeshTable,
    RecordTable,
    RunTable,
    SensorTable,
    ServiceConfig,
    SynchronisationTable,
    TrackerTable,
)

__all__ = [
    "BusTable",
    "CameraTable",
    "ConfigError",
    "DeviceTable",
    "MeshTable",
    "PoseTable",
    "RecordTable",
    "RunTable",
    "SensorTable",
    "ServiceConfig",
    "SynchronisationTable",
    "TrackerTable",
    "load",
    "load_default",
    "loads",
    "to_toml",
]
