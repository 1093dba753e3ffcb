"""The configuration of a rig: TOML on disk, checked and frozen in memory.

Only commands, the public face, the composition root and the evaluation see these objects; parts take plain arguments.
"""

from abs_service.config.errors import ConfigError
from abs_service.config.loading import from_tables, load, load_default, loads, named, to_toml
from abs_service.config.merging import load_calibration
from abs_service.config.tables.calibration import CalibrationFile, CalibrationOrigin, DepthTable
from abs_service.config.tables.camera import CameraTable, PoseTable
from abs_service.config.tables.service import (
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
    "CalibrationFile",
    "CalibrationOrigin",
    "CameraTable",
    "ConfigError",
    "DepthTable",
    "DeviceTable",
    "MeshTable",
    "PoseTable",
    "RecordTable",
    "RunTable",
    "SensorTable",
    "ServiceConfig",
    "SynchronisationTable",
    "TrackerTable",
    "from_tables",
    "load",
    "load_calibration",
    "load_default",
    "loads",
    "named",
    "to_toml",
]
