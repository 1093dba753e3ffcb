"""Reads calibrations from calibration files and rig files."""

import os
from dataclasses import fields
from pathlib import Path
from typing import Any

from abs_service import config
from abs_service.calibration.files.rig_file import (
    Covariance,
    Residuals,
    RigCalibration,
    SensorCalibration,
    read_covariance,
)
from abs_service.config import plugins
from abs_service.config.tables.calibration import CovarianceTable, ProvenanceTable, SensorEvidence
from abs_service.report.provenance import DataFile, Provenance
from calib.camera import Camera
from calib.files import limited, nested


class StoredCalibrationError(Exception):
    """A file that lacks a part of a calibration."""


def load(path: Path) -> RigCalibration:
    """The calibration in a calibration file, or in a rig file with the calibration file that it names.

    Raises:
        ConfigError: the file, or the one that it names, cannot be used.
        StoredCalibrationError: the camera of a sensor is not complete.
        RigFileError: the covariances belong to another calibration.
    """
    rig = _raw(path)
    if "devices" not in rig:
        file = config.load_calibration(path)
        sensors = {name: _known(name, table, table, path) for name, table in file.sensors.items()}
        return _whole(file.name, sensors, file.provenance, file.covariance, path.parent)
    made = config.load(path)
    origin = made.calibration
    evidence = {} if origin is None else origin.sensors
    sensors = {
        name: _known(name, table, evidence.get(name, SensorEvidence()), path) for name, table in made.sensors.items()
    }
    if origin is None:
        return RigCalibration(made.name, sensors, Provenance("", ""))
    folder = (path.parent / rig["calibration"]).parent if isinstance(rig["calibration"], str) else path.parent
    return _whole(made.name, sensors, origin.provenance, origin.covariance, folder)


def _raw(path: Path) -> dict[str, Any]:
    try:
        return nested.toml(limited.text(path))
    except (OSError, ValueError):
        return {}  # reported when it is read as a calibration


def _known(name: str, table: Any, evidence: SensorEvidence, path: Path) -> SensorCalibration:
    """Calibration of one sensor, from its table in either kind of file."""
    depth = table.depth or config.DepthTable()
    return SensorCalibration(
        camera(name, table.camera, path),
        depth.offset,
        depth.scale,
        (table.time_offset_ms or 0.0) / 1e3,
        _plugin(table.noise, path.parent),
        _plugin(table.texture, path.parent),
        None if evidence.factory is None else camera(f"{name}.factory", evidence.factory, path),
        Residuals(**evidence.residuals.model_dump()),
    )


def camera(name: str, table: config.CameraTable, path: Path) -> Camera:
    """The camera that a table describes completely; without a pose, it is at the rig's origin.

    Args:
        name: of the sensor, for messages.
        table: the table.
        path: file that it stands in, for messages.

    Raises:
        StoredCalibrationError: it leaves the image and the camera matrix to the device.
    """
    found = table.own()
    if found is None:
        raise StoredCalibrationError(f"{path}: sensors.{name}.camera: width, height, fx, fy, cx, cy are missing")
    return found


def _plugin(settings: Any, folder: Path) -> dict[str, Any]:
    """The table of a noise model, paths as seen from the folder of the file that it stands in."""
    if settings is None:
        return {}
    paths = {one.name: getattr(settings, one.name) for one in fields(settings)}
    relative = {name: os.path.relpath(path, folder.resolve()) for name, path in paths.items() if isinstance(path, Path)}
    return plugins.table(settings) | relative


def _whole(
    name: str,
    sensors: dict[str, SensorCalibration],
    origin: ProvenanceTable,
    covariance: CovarianceTable | None,
    folder: Path,
) -> RigCalibration:
    data = tuple(DataFile(one.name, one.sha256) for one in origin.data)
    provenance = Provenance(origin.command, origin.date, origin.version, data)
    beside = Covariance() if covariance is None else read_covariance(folder / covariance.file, covariance.sha256)
    return RigCalibration(name, sensors, provenance, origin.verdict, beside)
