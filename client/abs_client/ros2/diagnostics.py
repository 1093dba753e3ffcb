"""Health as ROS messages."""

from collections.abc import Mapping, Sequence
from typing import Any

from absmsg.v1.health_pb2 import Health

from abs_client.ros2 import cdr

OK, WARN, ERROR, STALE = 0, 1, 2, 3

_LEVELS = {Health.LEVEL_OK: OK, Health.LEVEL_WARNING: WARN, Health.LEVEL_ERROR: ERROR}


def array(header: Any, statuses: Sequence[Any]) -> Any:
    """A diagnostic_msgs/DiagnosticArray."""
    return cdr.make("diagnostic_msgs/msg/DiagnosticArray", header=header, status=list(statuses))


def status(name: str, rig: str, level: int, said: str, values: Mapping[str, object]) -> Any:
    """A diagnostic_msgs/DiagnosticStatus.

    Args:
        name: of the component, `<rig>/<component>`.
        rig: its hardware.
        level: OK, WARN, ERROR or STALE.
        said: plain words.
        values: everything else.
    """
    return cdr.make(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=level,
        name=name,
        message=said,
        hardware_id=rig,
        values=[cdr.make("diagnostic_msgs/msg/KeyValue", key=key, value=str(value)) for key, value in values.items()],
    )


def health(sent: Health, rig: str) -> Any:
    """A component's health with its counters, gauges and labels."""
    values = {**sent.labels, **sent.counters, **sent.gauges}
    one = status(f"{rig}/{sent.component}", rig, _LEVELS.get(sent.level, STALE), sent.message, values)
    return array(cdr.header(sent.header, rig), [one])
