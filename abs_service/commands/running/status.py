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
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys, rig_health
from abs_service.bus.security import roles
from abs_service.bus.security.mutual_tls import NO_SECURITY, MutualTls, NoSecurity
from abs_service.bus.session import DEFAULT_ENDPOINT, BusError, check_endpoint
from abs_service.commands.parts import rig_process
from abs_service.display.terminal.health_words import words
from abs_service.supervision.children.child import PROCESS, ChildState
from abs_service.supervision.exit_codes import Exit
from drivers.contract.text import printable

SILENT = "silent"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service status`."""
    parser.add_argument("config", metavar="CONFIG", nargs="?", type=Path, help="TOML file of the rig (default: any)")
    parser.add_argument("--connect", metavar="ENDPOINT", help="ask there instead of at bus.endpoint")
    parser.add_argument("--rig", metavar="NAME", help="only this rig")
    parser.add_argument("--json", action="store_true", help="one JSON object per rig, with all counters")


def run(arguments: argparse.Namespace) -> int:
    """Prints the health of every part and returns its exit code."""
    endpoint, name, security = _whom(arguments)
    check_endpoint(endpoint, security)
    try:
        answers = rig_health.ask(endpoint, name, security)
    except BusError as error:
        return _nothing(str(error))
    if not answers:
        which = "no rig" if name == "*" else f'no rig "{name}"'
        return _nothing(f"{which} answers at {endpoint} within {rig_health.PATIENCE_S:g} s")
    for rig, components in sorted(answers.items()):
        parts = [_part(component, health) for component, health in components.items()] + _absent(components)
        parts.sort(key=lambda part: part["component"])
        print(json.dumps({"rig": rig, "parts": parts}, ensure_ascii=False) if arguments.json else _lines(rig, parts))
    wrong = any(_level(health) in ("error", SILENT) for parts in answers.values() for health in parts.values())
    return Exit.FAILED if wrong else Exit.OK


def _whom(arguments: argparse.Namespace) -> tuple[str, str, NoSecurity | MutualTls]:
    """Endpoint and name of the rig, `*` for any, and who it is that asks."""
    endpoint, name, security = DEFAULT_ENDPOINT, "*", NO_SECURITY
    if arguments.config:
        rig = rig_process.load_config(arguments)
        endpoint, name, security = rig.bus.endpoint, rig.name, rig.bus.security(roles.RIG, *roles.READERS)
    return arguments.connect or endpoint, name if arguments.rig is None else keys.check_name(arguments.rig), security


def _nothing(reason: str) -> Exit:
    print(f"abs-service: {reason}", file=sys.stderr)
    return Exit.NOTHING


def _level(health: Health | None) -> str:
    return SILENT if health is None else Health.Level.Name(health.level).removeprefix("LEVEL_").lower()


def _part(component: str, health: Health | None) -> dict[str, Any]:
    if health is None:
        reason = f"runs, but sent no health for {rig_health.PATIENCE_S:g} s"
        return {"component": component, "level": SILENT, "state": "", "reason": reason}
    return {
        "component": component,
        "level": _level(health),
        "state": words(component, health),
        "reason": health.message,
        "counters": dict(health.counters),
        "gauges": dict(health.gauges),
        "labels": dict(health.labels),
    }


def _absent(components: Mapping[str, Health | None]) -> list[dict[str, Any]]:
    """Processes that only `run` reports: they start, start again, or were given up."""
    run = components.get("run") or Health()
    reasons = {
        name.removeprefix(PROCESS): text for name, text in run.labels.items() if name.startswith(PROCESS) and text
    }
    return [
        {
            "component": name,
            "level": "error" if text.startswith(ChildState.FAILED) else "warning",
            "state": "",
            "reason": text,
        }
        for name, text in reasons.items()
        if name not in components
    ]


def _lines(rig: str, parts: list[dict[str, Any]]) -> str:
    width = max(len(part["component"]) for part in parts)
    lines = [
        f"{rig}  {part['component']:<{width}}  {part['level']:<7}  "
        + "; ".join(text for text in (part["state"], part["reason"]) if text)
        for part in parts
    ]
    # Names are those of keys, which may be anybody's; a message of several lines stays one part's line.
    return "\n".join(printable(line.replace("\n", " ")).rstrip() for line in lines)
