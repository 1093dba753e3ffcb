"""Processes of a running rig that have to start again, so that another configuration takes effect."""

from dataclasses import dataclass
from typing import Any

from abs_service.config.tables.service import ServiceConfig

#: Keys that every process has read, or that decide which processes there are.
FIXED = ("version", "name", "bus", "run")

#: Keys of a sensor that the process with the devices reads when it starts.
OPENED_WITH = ("device", "head", "camera", "view_hz")


@dataclass(frozen=True, slots=True)
class Changes:
    """The difference between two configurations of a rig.

    Attributes:
        fixed: keys that differ and cannot change as long as the rig runs.
        components: names, as in health, of the processes that have to start, or to start again.
        ends: those of the processes that have to end.
    """

    fixed: tuple[str, ...]
    components: tuple[str, ...]
    ends: tuple[str, ...] = ()


def between(old: ServiceConfig, new: ServiceConfig) -> Changes:
    """The difference of two configurations.

    A recording has one configuration, so the recorder begins another file whatever changes.
    """
    before, after = (rig.model_dump(mode="json") for rig in (old, new))
    if before == after:
        return Changes((), ())
    fixed = [key for key in FIXED if before[key] != after[key]]
    if before["record"]["enabled"] != after["record"]["enabled"]:
        fixed.append("record.enabled")
    if fixed:
        return Changes(tuple(fixed), ())
    capture = ["capture"] if _opened(before) != _opened(after) else []
    trackers = [f"track/{name}" for name in after["trackers"] if _tracked(before, name) != _tracked(after, name)]
    ends = tuple(f"track/{name}" for name in before["trackers"] if name not in after["trackers"])
    record = ["record"] if after["record"]["enabled"] else []
    page = ["view"] if any(before[key] != after[key] for key in ("devices", "sensors", "trackers")) else []
    return Changes((), (*capture, *trackers, *record, *page), ends)


def _opened(rig: dict[str, Any]) -> object:
    """Everything that the process with the devices has read."""
    heads = {name: [sensor[key] for key in OPENED_WITH] for name, sensor in rig["sensors"].items()}
    return rig["devices"], heads


def _tracked(rig: dict[str, Any], tracker: str) -> object:
    """Everything that one tracker has read; None if there is no such tracker."""
    if tracker not in rig["trackers"]:
        return None
    table = rig["trackers"][tracker]
    sensors = {name: rig["sensors"][name] for name in table["sensors"]}
    devices = {sensor["device"]: rig["devices"][sensor["device"]] for sensor in sensors.values()}
    return table, sensors, devices, rig["synchronisation"]
