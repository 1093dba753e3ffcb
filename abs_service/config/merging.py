"""A calibration file read, and put into the rig that names it."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from abs_service.config.errors import ConfigError, allowed_at, error_of
from abs_service.config.problems import Key, Problem, allowed_instead, dotted, from_pydantic
from abs_service.config.tables.calibration import (
    SHARED,
    CalibratedSensor,
    CalibrationFile,
    CalibrationOrigin,
    SensorOrigin,
)
from calib.files import limited, nested


def load_calibration(path: Path) -> CalibrationFile:
    """The calibration in a file; relative paths in it start from the file's folder.

    Raises:
        ConfigError: it cannot be read or used; names all that is wrong with it.
    """
    return _parse(path, _read(path))


def merge(rig: dict[str, Any], source: str, base: Path, text: str) -> dict[str, Any]:
    """A rig file merged with the calibration file that its key `calibration` names.

    Args:
        rig: content of the TOML file; returned as it is if it names no calibration file.
        source: where it came from, for messages.
        base: folder that the path of the calibration file starts from.
        text: the rig file's content, for the numbers of its lines.

    Raises:
        ConfigError: the calibration file cannot be used, is about sensors that the rig does not have, or has
            keys that the rig file has, too.
    """
    if not isinstance(rig.get("calibration"), str):
        return rig
    path = base / rig["calibration"]
    content = _read(path)
    file = _parse(path, content)
    sensors = rig["sensors"] if isinstance(rig.get("sensors"), dict) else {}
    unknown = [
        Problem(("sensors", name), f"no such sensor in {source}, {allowed_instead(name, sensors)}")
        for name in file.sensors
        if name not in sensors
    ]
    if unknown:
        raise error_of(str(path), unknown, _text(content))
    given = {name: _given(calibrated) for name, calibrated in file.sensors.items()}
    tables = {name: sensors[name] if isinstance(sensors[name], dict) else {} for name in given}
    clashes = [problem for name in given for problem in _clashes(name, tables[name], given[name], path)]
    if clashes:
        raise error_of(source, clashes, text)
    merged = {name: _merged(tables[name], given[name]) for name in given}
    return rig | {"sensors": sensors | merged, "calibration": _origin(path, content, file, given)}


def without_calibrated(problems: Iterable[Problem]) -> list[Problem]:
    """Problems that a calibration file, which could not be read, may not be the reason of."""
    return [one for one in problems if not (one.key[:1] == ("sensors",) and set(one.key[2:3]) & set(SHARED))]


def _read(path: Path) -> bytes:
    try:
        return limited.read(path, limited.MAX_TEXT_BYTES)
    except OSError as error:
        raise ConfigError(f"{path}: the calibration cannot be read: {error.strerror}") from None


def _text(content: bytes) -> str:
    """The text of a file without a byte order mark, as `limited.text` has it."""
    return content.decode("utf-8-sig")


def _parse(path: Path, content: bytes) -> CalibrationFile:
    text = ""
    try:
        text = _text(content)
        file = nested.toml(text)
        # JSON in strict mode is TOML's own type system, as for the rig's own file.
        tables = json.dumps(file, default=str)
        return CalibrationFile.model_validate_json(tables, strict=True, context={"base": path.resolve().parent})
    except ValidationError as error:
        raise error_of(str(path), from_pydantic(error, partial(allowed_at, CalibrationFile)), text) from None
    except ValueError as error:  # no UTF-8, or no TOML
        raise ConfigError(f"{path}: not TOML: {error}") from None


def _given(calibrated: CalibratedSensor) -> dict[str, Any]:
    """Keys of a sensor that a rig file can have; paths absolute, no empty tables."""
    tables = calibrated.model_dump(mode="json", exclude_none=True, include=set(SHARED))
    return {key: value for key, value in tables.items() if value != {}}


def _keys(given: dict[str, Any]) -> Iterator[Key]:
    """The keys that one file may have if the other has not; a camera's are separate, all others stand as a whole."""
    for key, value in given.items():
        yield from ((key, part) for part in value) if key == "camera" else [(key,)]


def _clashes(name: str, table: dict[str, Any], given: dict[str, Any], path: Path) -> Iterator[Problem]:
    for key in _keys(given):
        value: Any = table
        for part in key:
            value = value.get(part) if isinstance(value, dict) else None
        if value is not None:
            where = ("sensors", name, *key)
            yield Problem(where, f"{path} has {dotted(where)} too; remove it from one of the two files", value)


def _merged(table: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    own = table.get("camera", {})
    # What is no table will be refused as such, together with the other mistakes of the rig file.
    camera = {"camera": own | given.get("camera", {}) if isinstance(own, dict) else own}
    return table | given | (camera if "camera" in table else {})


def _origin(path: Path, content: bytes, file: CalibrationFile, given: dict[str, Any]) -> dict[str, Any]:
    """The `calibration` table of the merged configuration."""
    origin = CalibrationOrigin(
        file=path.name,
        sha256=hashlib.sha256(content).hexdigest(),
        provenance=file.provenance,
        covariance=file.covariance,
        sensors={
            name: SensorOrigin(
                keys=tuple(dotted(key) for key in _keys(given[name])),
                factory=sensor.factory,
                sigma=sensor.sigma,
                residuals=sensor.residuals,
            )
            for name, sensor in file.sensors.items()
        },
    )
    return origin.model_dump(mode="json", exclude_none=True)
