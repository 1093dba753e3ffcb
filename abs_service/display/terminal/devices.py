"""Attached devices as a table, with a remedy for each one that cannot be used."""

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from drivers.contract.controls import Controls
from drivers.contract.device import Device
from drivers.contract.discovery import Availability, Found

_STYLES = {
    Availability.READY: "green",
    Availability.BUSY: "yellow",
    Availability.NO_PERMISSION: "red",
    Availability.SDK_MISSING: "dim",
    Availability.FAULTY: "red",
}


def overview(found: Sequence[Found]) -> RenderableType:
    """All devices, those first that can be used."""
    attached = [one for one in found if one.availability != Availability.SDK_MISSING]
    missing = [one for one in found if one.availability == Availability.SDK_MISSING]
    parts: list[RenderableType] = [_table(attached)] if attached else [Text("No camera is attached.", "bold")]
    parts += [_advice(one) for one in attached if one.availability != Availability.READY]
    if missing:
        parts.append(Text("\nNot looked for, because the driver is not installed:", "dim"))
        parts += [_verbatim(f"  {one.info.uri}  {one.reason}:  {one.remedy}") for one in missing]
    if not attached:
        parts.append(Text("\n`abs-service run` needs none: it simulates one.", "dim"))
    return Group(*parts)


def line(sign: str, one: Found) -> Text:
    """One device that came (+), went (-) or changed (~), on a line."""
    what = [one.info.model, one.info.link, one.availability.value, one.reason]
    text = Text.assemble((f"{sign} ", "bold"), (one.info.uri, "bold"), "  ", ", ".join(filter(None, what)))
    text.stylize({"+": "green", "-": "red"}.get(sign, "yellow"), 0, 1)
    return text


def description(device: Device) -> RenderableType:
    """Everything that one opened device can do."""
    info, capabilities = device.info, device.capabilities
    about = filter(None, [info.model, info.serial, info.firmware and f"firmware {info.firmware}", info.link])
    streams = Table(box=None, header_style="dim", padding=(0, 2, 0, 0))
    for column in ("stream", "size", "encoding", "rate", "clock"):
        streams.add_column(column)
    for stream in capabilities.streams:
        clock = f"{stream.clock.domain} {stream.clock.tick_hz:g} Hz" if stream.clock.tick_hz else stream.clock.domain
        size = f"{stream.width} × {stream.height}"
        streams.add_row(f"{stream.sensor}/{stream.stream}", size, stream.encoding, f"{stream.rate_hz:g} Hz", clock)
    roles = ", ".join(role.value for role in capabilities.sync_roles)
    return Group(
        Text.assemble((info.uri, "bold"), f"  {', '.join(about)}\n"),
        streams,
        Text(f"\nsynchronisation: {roles}"),
        _controls(device.controls),
    )


def _table(found: Sequence[Found]) -> Table:
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0))
    table.add_column("device", overflow="fold", min_width=18)
    for column in ("model", "serial", "firmware", "link"):
        table.add_column(column, overflow="fold")
    table.add_column("state", no_wrap=True, min_width=max(len(one.availability) for one in found))
    for one in sorted(found, key=lambda one: (one.availability != Availability.READY, one.info.uri)):
        info, style = one.info, _STYLES[one.availability]
        state = Text(one.availability.value, style)
        table.add_row(Text(info.uri, "bold"), info.model, info.serial or "–", info.firmware or "–", info.link, state)
    return table


def _advice(one: Found) -> RenderableType:
    head = Text.assemble("\n", (one.info.uri, "bold"), f": {one.reason}")
    return Group(head, Padding(_verbatim(one.remedy), (0, 0, 0, 2))) if one.remedy else head


def _verbatim(text: str) -> Text:
    """Text that is not broken into lines, because it holds commands to copy."""
    return Text(text, no_wrap=True, overflow="ignore")


def _controls(controls: Controls) -> RenderableType:
    if not controls.infos:
        return Text("controls: none")
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0))
    for column in ("control", "now", "allowed"):
        table.add_column(column)
    for info in controls.infos:
        table.add_row(info.name, str(controls.get(info.name)), info.allowed)
    return table
