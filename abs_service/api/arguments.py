"""Configuration of a rig file from the arguments of a tracker, with its defaults and checks."""

import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from abs_service import config
from abs_service.api.checks import ArgumentError
from abs_service.tracker.measurements import measurement
from abs_service.tracking.plan import ModelSettings
from calib.noise.base import NoiseError
from calib.rig import Noise
from drivers.contract.frame import Kind

#: What a rig file holds for a part of a tracker, `{"type": "hybrid", "steps": 4}`.
Table = Mapping[str, Any]


class NoiseSettings(Protocol):
    """Settings of a noise model."""

    def build(self) -> Noise:
        """The noise model."""
        ...


#: A model and a noise model: settings such as `Nurbs(4, 4)`, or a table of a rig file.
ModelPart = ModelSettings | Table
NoisePart = NoiseSettings | Table

#: Names in the configuration of a tracker that is made from arguments.
TRACKER, DEPTH, COLOR = "tracker", "depth", "color"

#: What messages say of that configuration, and what they have to say of the arguments that gave it.
_ARGUMENTS = {
    rf"trackers\.{TRACKER}\.mesh\.": "",
    rf"trackers\.{TRACKER}\.": "",
    rf"sensors\.{COLOR}\.noise": "color_noise",
    rf"sensors\.{DEPTH}\.": "",
    r'\{ type = ("\w+"), … \}': r'{"type": \1, …}',
    r"region\.file: missing, but needed": r"\g<0>: the path of an image; pixels are given to track(…, mask=array)",
}

#: Settings as they are written, by the arguments that take no other kind of table.
_EXAMPLES = {
    "model": "a.Nurbs(4, 4)",
    "noise": "a.noise.Constant(0.001)",
    "color_noise": "a.noise.Color()",
    "texture": 'a.noise.Intensity("amplitude", 5)',
}


def configuration(
    sensor: Table, color_noise: NoisePart | None, tracker: Table, vertices: int | None
) -> config.ServiceConfig:
    """The configuration of one tracker with a depth camera and, if it has a noise model, a colour camera.

    Args:
        sensor: keys of the depth sensor's table; None leaves one out.
        color_noise: noise model of the colour camera.
        tracker: keys of the tracker's table; None leaves one out.
        vertices: about how many vertices the mesh is to have; None: the default of a rig file.

    Raises:
        ArgumentError: names all that is wrong.
    """
    sensors = {DEPTH: _keys(sensor)}
    if color_noise is not None:
        sensors[COLOR] = {"noise": _plain("color_noise", color_noise)}
    mesh = {} if vertices is None else {"mesh": _keys({"vertices": vertices})}
    tables = {
        "version": 1,
        "name": "arrays",
        "devices": {"arrays": {"uri": "arrays://"}},
        "sensors": {name: {"device": "arrays", **table} for name, table in sensors.items()},
        "synchronisation": {"reference": f"{DEPTH}/depth"},
        "trackers": {TRACKER: {"sensors": list(sensors), **_keys(tracker), **mesh}},
    }
    try:
        settings = config.from_tables(tables, "Tracker", Path.cwd())
        pictures = [table.noise.build() for name, table in settings.sensors.items() if name == COLOR and table.noise]
    except (config.ConfigError, NoiseError) as error:
        raise ArgumentError(in_arguments(str(error))) from None
    if any(measurement(noise).frames[0] not in (Kind.COLOR, Kind.BAYER) for noise in pictures):
        raise ArgumentError(f"color_noise = {color_noise}: must be noise.Color(), noise.Grey() or noise.Bayer()")
    return settings


def in_arguments(message: str) -> str:
    """A message about a configuration in terms of the arguments that it was made from."""
    for written, argument in _ARGUMENTS.items():
        message = re.sub(written, argument, message)
    return message


def _keys(given: Table) -> dict[str, Any]:
    return {key: _plain(key, value) for key, value in given.items() if value is not None}


def _plain(name: str, value: Any) -> Any:
    """A value as a TOML file would hold it."""
    if isinstance(value, Mapping):
        return {key: _plain(f"{name}.{key}", part) for key, part in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        table = {field.name: getattr(value, field.name) for field in fields(value)}
        given = {key: part for key, part in table.items() if part is not None}
        return {"type": type(value).__module__.rpartition(".")[2]} | _plain(name, given)
    if name in _EXAMPLES or isinstance(value, type) or callable(value):
        example = f"such as {name}={_EXAMPLES[name]}, or a table" if name in _EXAMPLES else "or a table"
        raise ArgumentError(f'{name} = {value!r}: must be settings, {example} such as {{"type": "…"}}')
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
