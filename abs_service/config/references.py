"""Checks of references between tables: each name must exist and be unambiguous."""

from collections.abc import Iterator
from typing import Any

from abs_service.config.problems import Problem, allowed_instead
from abs_service.config.tables.values import URI

#: Starting points that need no measurement.
NOISE_EXAMPLES = (
    '{ type = "structured_light" } of a structured-light or stereo camera, { type = "constant", sigma = 0.01 } [m] of '
    'a time-of-flight camera, { type = "color", sigma = 20.0 } of colours'
)


def check(file: dict[str, Any]) -> list[Problem]:
    """All dangling or ambiguous references in a file.

    Works on the raw tables, so that these problems are reported together with all others.
    """
    return [*_sensors(file), *_references(file), *_trackers(file), *_record(file)]


def uris(file: dict[str, Any]) -> dict[str, str]:
    """The addresses of the devices in a file that are addresses at all, by the names of the devices."""
    given = {name: table.get("uri") for name, table in _tables(file, "devices").items()}
    return {name: uri for name, uri in given.items() if isinstance(uri, str) and URI.fullmatch(uri)}


def _tables(file: dict[str, Any], section: str) -> dict[str, dict[str, Any]]:
    tables = file.get(section)
    return {k: v for k, v in tables.items() if isinstance(v, dict)} if isinstance(tables, dict) else {}


def _sensors(file: dict[str, Any]) -> Iterator[Problem]:
    devices, owners = _tables(file, "devices"), {}
    for name, sensor in _tables(file, "sensors").items():
        device, head = sensor.get("device"), sensor.get("head") or name
        if not isinstance(device, str):
            continue
        if device not in devices:
            yield Problem(("sensors", name, "device"), f"no such device, {allowed_instead(device, devices)}", device)
        elif (owner := owners.setdefault((device, head), name)) != name:
            yield Problem(("sensors", name), f'sensor "{owner}" is head "{head}" of device "{device}" already')


def _references(file: dict[str, Any]) -> Iterator[Problem]:
    sensors = _tables(file, "sensors")
    places = {("trackers", name): table for name, table in _tables(file, "trackers").items()}
    for place, table in {("synchronisation",): file.get("synchronisation", {}), **places}.items():
        reference = table.get("reference", "") if isinstance(table, dict) else ""
        sensor, slash, _ = reference.partition("/") if isinstance(reference, str) else ("", "", "")
        if slash and sensor not in sensors:
            yield Problem((*place, "reference"), f"no such sensor, {allowed_instead(sensor, sensors)}", reference)


def _trackers(file: dict[str, Any]) -> Iterator[Problem]:
    sensors, synchronisation = _tables(file, "sensors"), file.get("synchronisation")
    shared = isinstance(synchronisation, dict) and synchronisation.get("reference")
    for name, tracker in _tables(file, "trackers").items():
        if name in sensors:
            yield Problem(("trackers", name), "a sensor has this name; sensors and trackers need different names")
        given = tracker.get("sensors")
        used = [sensor for sensor in given if isinstance(sensor, str)] if isinstance(given, list) else []
        for index, sensor in enumerate(used):
            if sensor not in sensors:
                yield Problem(
                    ("trackers", name, "sensors", index), f"no such sensor, {allowed_instead(sensor, sensors)}", sensor
                )
            elif "noise" not in sensors[sensor]:
                yield Problem(
                    ("sensors", sensor, "noise"),
                    f'missing, but tracker "{name}" weighs its measurements with it, such as {NOISE_EXAMPLES}',
                )
            if sensor in used[:index]:
                yield Problem(("trackers", name, "sensors", index), "named twice", sensor)
        synthesis = tracker.get("synthesis")
        view = synthesis.get("sensor") if isinstance(synthesis, dict) else None
        if used and isinstance(view, str) and view not in ("", *used):
            yield Problem(
                ("trackers", name, "synthesis", "sensor"),
                f"no sensor of this tracker, {allowed_instead(view, used)}",
                view,
            )
        if not (tracker.get("reference") or shared):
            yield Problem(
                ("trackers", name, "reference"),
                "missing: the stream that paces the tracker, here or as synchronisation.reference",
            )


def _record(file: dict[str, Any]) -> Iterator[Problem]:
    record = file.get("record")
    if not isinstance(record, dict) or _tables(file, "trackers"):
        return
    if record.get("begin") == "tracking":
        yield Problem(("record", "begin"), 'the rig has no tracker to wait for; allowed is "start"', "tracking")
    if record.get("when") == "not_tracking":
        allowed = 'the rig has no tracker; allowed are "always" and "requested"'
        yield Problem(("record", "when"), allowed, "not_tracking")
