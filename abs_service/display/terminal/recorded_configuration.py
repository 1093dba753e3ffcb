"""The configuration that a recording was made with, as values and as lines for people."""

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

from drivers.contract.text import printable
from drivers.replay.contents import Contents

#: Attachment with the configuration of the rig.
FILE = "rig.toml"


def text(contents: Contents) -> str:
    """The configuration as TOML; "" if there is none."""
    return contents.attachments.get(FILE, b"").decode("utf-8", "replace")


def values(contents: Contents) -> dict[str, Any]:
    """The configuration; empty if there is none, or one that is no TOML."""
    try:
        return tomllib.loads(text(contents))
    except tomllib.TOMLDecodeError:
        return {}


def lines(configuration: Mapping[str, Any]) -> Iterator[str]:
    """A line for each device and each tracker: address; sensors, and the types of its parts."""
    for name, device in _tables(configuration, "devices"):
        yield printable(f"device {name}: {device.get('uri', '')}")
    for name, tracker in _tables(configuration, "trackers"):
        sensors = tracker.get("sensors")
        of = ", ".join(map(str, sensors)) if isinstance(sensors, list) else "its sensors"
        parts = (f"{key} {part['type']}" for key, part in tracker.items() if isinstance(part, dict) and "type" in part)
        yield printable(f"tracker {name} of {of}: {', '.join(parts)}")


def _tables(configuration: Mapping[str, Any], key: str) -> list[tuple[str, dict[str, Any]]]:
    tables = configuration.get(key)
    found = tables.items() if isinstance(tables, dict) else ()
    return [(name, table) for name, table in found if isinstance(table, dict)]
