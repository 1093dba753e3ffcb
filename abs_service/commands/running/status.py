"""Asks a running rig how it is: one line for each of its parts, with the reason where something is wrong.

  abs-service status                                   what listens at tcp/127.0.0.1:7447
  abs-service status rig.toml                          the rig of that file, at its bus.endpoint
  abs-service status --connect tcp/lab4:7447 --json    another host's, for scripts

Exit code 0: everything works, warnings included; 1: a part reports an error or sends no health; 2: wrong arguments;
3: nothing answers. It answers within two seconds.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys, rig_health
from abs_service.bus.security import roles
from abs_service.bus.security.mutual_tls import NO_SECURITY, MutualTls, NoSecurity
from abs_service.bus.session import DEFAULT_ENDPOINT, ENDPOINT_KEY, BusError, check_endpoint
from abs_service.commands.parts import rig_process
from abs_service.display.terminal.health_words import words
from abs_service.supervision.children.child import PROCESS, ChildState
from abs_service.supervision.exit_codes import Exit
from drivers.contract.text import printable

SILENT, STARTS = "silent", "starts"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service status`."""
    parser.add_argument("config", metavar="CONFIG", nargs="?", type=Path, help="TOML file of the rig (default: any)")
    parser.add_argument("--connect", metavar="ENDPOINT", help="ask there instead of at bus.endpoint")
    parser.add_argument("--rig", metavar="NAME", help="only this rig")
    parser.add_argument("--json", action="store_true", help="one JSON object per rig, with all counters")


def run(arguments: argparse.Namespace) -> int:
    """Prints the health of every part and returns its exit code."""
    endpoint, name, security = _whom(arguments)
    key = "--connect" if arguments.connect is not None else ENDPOINT_KEY
    check_endpoint(endpoint, security, key)
    try:
        answers = rig_health.ask(endpoint, name, security, _running, key)
    except BusError as error:
        return _nothing(str(error))
    if not answers:
        which = "no rig" if name == "*" else f'no rig "{name}"'
        return _nothing(f"{which} answers at {endpoint} within {rig_health.PATIENCE_S:g} s")
    wrong = False
    for rig, components in sorted(answers.items()):
        parts = [_part(component, health) for component, health in components.items()] + _absent(components)
        parts.sort(key=lambda part: part["component"])
        wrong |= any(part["level"] in ("error", SILENT) for part in parts)
        print(json.dumps({"rig": rig, "parts": parts}, ensure_ascii=False) if arguments.json else _lines(rig, parts))
    return Exit.FAILED if wrong else Exit.OK


def _whom(arguments: argparse.Namespace) -> tuple[str, str, NoSecurity | MutualTls]:
    """Endpoint and name of the rig, `*` for any, and who it is that asks."""
    endpoint, name, security = DEFAULT_ENDPOINT, "*", NO_SECURITY
    if arguments.config:
        rig = rig_process.load_config(arguments)
        endpoint, name, security = rig.bus.endpoint, rig.name, rig.bus.security(roles.RIG, *roles.READERS)
    name = name if arguments.rig is None else keys.check_name(arguments.rig)
    return endpoint if arguments.connect is None else arguments.connect, name, security


def _nothing(reason: str) -> Exit:
    print(f"abs-service: {reason}", file=sys.stderr)
    return Exit.NOTHING


def _part(component: str, health: Health | None) -> dict[str, Any]:
    if health is None:
        reason = f"runs, but sent no health for {rig_health.PATIENCE_S:g} s"
        return {"component": component, "level": SILENT, "state": "", "reason": reason}
    return {
        "component": component,
        "level": Health.Level.Name(health.level).removeprefix("LEVEL_").lower(),
        "state": words(component, health),
        "reason": health.message,
        "counters": dict(health.counters),
        "gauges": dict(health.gauges),
        "labels": dict(health.labels),
    }


def _absent(components: Mapping[str, Health | None]) -> list[dict[str, Any]]:
    """Processes that only `run` reports: they start, start again, were given up, or hang."""
    return [
        {
            "component": name,
            "level": _level(text),
            "state": "",
            "reason": STARTS if text == ChildState.RUNNING else text,
        }
        for name, text in _processes(components)
        if name not in components
    ]


def _level(condition: str) -> str:
    """Level of a process that sends no health, by its condition in the health of `run`."""
    if condition.startswith(ChildState.FAILED):
        return "error"
    # One that has just started cannot speak yet; of one that should, `run` adds a reason.
    return SILENT if condition.startswith(ChildState.RUNNING) and condition != ChildState.RUNNING else "warning"


def _running(components: Mapping[str, Health | None]) -> Iterator[str]:
    """Names of the components that run, by what `run` reports; also those beside the rig's work, such as a page."""
    return (name for name, text in _processes(components) if text == ChildState.RUNNING)


def _processes(components: Mapping[str, Health | None]) -> Iterator[tuple[str, str]]:
    for name, text in (components.get("run") or Health()).labels.items():
        if name.startswith(PROCESS) and text:
            yield name.removeprefix(PROCESS), text


def _lines(rig: str, parts: list[dict[str, Any]]) -> str:
    width = max(len(part["component"]) for part in parts)
    lines = [
        f"{rig}  {part['component']:<{width}}  {part['level']:<7}  "
        + "; ".join(text for text in (part["state"], part["reason"]) if text)
        for part in parts
    ]
    # Names are those of keys, which may be anybody's; a message of several lines stays one part's line.
    return "\n".join(printable(line.replace("\n", " ")).rstrip() for line in lines)
