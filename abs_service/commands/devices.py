"""Lists the attached cameras, and the remedy for each that cannot be used.

  abs-service devices                        all, with model, serial number, firmware, link and state
  abs-service devices --watch                who comes and goes, until Ctrl-C
  abs-service devices oak://18443010F1AEC2   what one of them can do: streams, controls and their ranges
  abs-service devices --json                 the same for scripts; with --watch one object per line
  abs-service devices --udev                 the rules that let people at this machine open the cameras

The first column is the address for a rig file: [devices.NAME] uri = "…".
"""

import argparse
import json
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict
from importlib import resources
from typing import Any

from rich.console import Console

from abs_service.commands.parts import rig_process
from abs_service.display.terminal import devices as display
from abs_service.display.terminal.console import TableConsole
from abs_service.supervision.exit_codes import Exit
from drivers import opening
from drivers.contract.device import Device
from drivers.contract.discovery import Found

RULES = "60-abs-service.rules"
#: Time between two searches with --watch [s].
PERIOD_S = 1.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service devices`."""
    parser.add_argument("device", metavar="URI", nargs="?", help="describe this device instead of listing all")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--watch", action="store_true", help="follow who comes and goes")
    what.add_argument("--udev", action="store_true", help="print the udev rules")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument(
        "--timeout", metavar="S", type=rig_process.seconds, default=2.0, help="time to look for devices (default: 2)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Lists, watches, describes or prints the rules."""
    console = TableConsole(soft_wrap=False)
    if arguments.udev:
        print(resources.files("drivers.contract").joinpath(RULES).read_text(encoding="utf-8"), end="")
    elif arguments.watch:
        _watch(console, arguments)
    elif arguments.device:
        with closing(opening.open_device(arguments.device, time.monotonic_ns)) as device:
            if arguments.json:
                print(json.dumps(description(device), ensure_ascii=False))
            else:
                console.print(display.description(device))
    else:
        found = opening.discover(arguments.timeout)
        if arguments.json:
            print(json.dumps({"devices": [as_dict(one) for one in found]}, ensure_ascii=False, indent=2))
        else:
            console.print(display.overview(found), crop=False)
    return Exit.OK


def as_dict(one: Found) -> dict[str, Any]:
    """A device as plain data."""
    state = {"state": one.availability.value, "reason": one.reason, "remedy": one.remedy}
    return asdict(one.info) | state


def description(device: Device) -> dict[str, Any]:
    """Capabilities of an opened device as plain data."""
    controls = []
    for info in device.controls.infos:
        # JSON has no infinity, which stands for "no limit".
        limits = {key: value for key, value in asdict(info).items() if value not in {math.inf, -math.inf}}
        controls.append(limits | {"value": device.controls.get(info.name), "allowed": info.allowed})
    return asdict(device.info) | asdict(device.capabilities) | {"controls": controls}


def changes(before: Sequence[Found], after: Sequence[Found]) -> Iterator[tuple[str, Found]]:
    """Devices that were added ("+"), removed ("-") or changed ("~")."""
    old = {(one.info.uri, one.info.serial): one for one in before}
    new = {(one.info.uri, one.info.serial): one for one in after}
    yield from (("-", one) for key, one in old.items() if key not in new)
    yield from (("+", one) for key, one in new.items() if key not in old)
    yield from (("~", one) for key, one in new.items() if key in old and one != old[key])


def _watch(console: Console, arguments: argparse.Namespace) -> None:
    stop = rig_process.stop_on_signals()
    known: Sequence[Found] = ()
    if not arguments.json:
        console.print("Watching; Ctrl-C ends.", style="dim")
    while not stop.is_set():
        found = opening.discover(arguments.timeout)
        for sign, one in changes(known, found):
            if arguments.json:
                event = {"+": "added", "-": "removed", "~": "changed"}[sign]
                print(json.dumps({"event": event, "device": as_dict(one)}, ensure_ascii=False), flush=True)
            else:
                console.print(display.line(sign, one), soft_wrap=True)
        known = found
        stop.wait(PERIOD_S)
