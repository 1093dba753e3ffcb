"""A display for a service of systemd: changes of state, as entries of the journal with fields to search by.

  journalctl ABS_RIG=lab ABS_COMPONENT=track/sheet -p warning

Levels and statuses are looked at once a second, so that one that flickers does not fill the disk.
"""

import os
import socket
import sys
from collections.abc import Callable, Mapping

from absmsg.v1.health_pb2 import Health

from abs_service.supervision.display import Display
from abs_service.supervision.health.rig_view import RigView
from abs_service.supervision.process_setup import log_lines
from abs_service.supervision.repeats import Repeats

SOCKET = "/run/systemd/journal/socket"
PERIOD_NS = 1_000_000_000

#: Priorities of the journal, which are syslog's.
_PRIORITIES = {Health.LEVEL_ERROR: "3", Health.LEVEL_WARNING: "4"}
_LOG_PRIORITIES = {"critical": "2", "error": "3", "warning": "4", "debug": "7"}
_INFORMATION = "6"


class JournalDisplay(Display):
    """Writes one entry for every change of a component's level, a tracker's status or a process's state.

    Levels and states that come again and again, as those of a process that never works, are written ever more rarely.
    """

    def __init__(self, send: Callable[[Mapping[str, str]], None]) -> None:
        self._send = send
        self._rig = ""
        self._reported: dict[tuple[str, str], str] = {}
        self._repeats = Repeats()
        self._now_ns = self._next_ns = 0

    def update(self, view: RigView) -> None:
        """See `Display`."""
        self._rig = view.rig.name
        if view.now_ns < self._next_ns:
            return
        self._now_ns = view.now_ns
        self._next_ns = view.now_ns + PERIOD_NS
        for component, received in view.live.received.items():
            level, message = received.health.level, received.health.message
            name = Health.Level.Name(level).removeprefix("LEVEL_").lower()
            priority = _PRIORITIES.get(level, _INFORMATION)
            self._tell_change("ABS_LEVEL", component, name, message, priority)
        for name, log in view.live.trackers.items():
            if log.last is not None:
                reasons = "; ".join(log.last.reasons)
                self._tell_change("ABS_STATUS", f"track/{name}", log.last.status, reasons, _INFORMATION)
        for child in view.children:
            self._tell_change("ABS_STATE", child.component, child.state.value, child.reason, _INFORMATION)

    def note(self, text: str) -> None:
        """See `Display`; a record of a log in JSON keeps its level and process."""
        record = log_lines.parse(text)
        if not record:
            self._entry({"MESSAGE": text, "PRIORITY": _INFORMATION})
            return
        exception = record.get("fields", {}).get("exception")
        message = str(record["message"]) + (f"\n{exception}" if exception else "")
        priority = _LOG_PRIORITIES.get(record.get("level", ""), _INFORMATION)
        self._entry({"MESSAGE": message, "PRIORITY": priority, "ABS_COMPONENT": str(record.get("process", ""))})

    def close(self, view: RigView) -> int:
        """See `Display`."""
        self.note("\n".join(view.summary()))
        return 0

    def _tell_change(self, field: str, component: str, value: str, reason: str, priority: str) -> None:
        if self._reported.get((field, component)) == value:
            return
        message = f"{component}: {value}" + (f": {reason}" if reason else "")
        if field != "ABS_STATUS" and self._repeats.take(message, self._now_ns) is None:
            return
        self._reported[field, component] = value
        self._entry({"MESSAGE": message, "PRIORITY": priority, "ABS_COMPONENT": component, field: value})

    def _entry(self, fields: Mapping[str, str]) -> None:
        self._send({**fields, "ABS_RIG": self._rig, "SYSLOG_IDENTIFIER": "abs-service"})


def is_attached(environment: Mapping[str, str], descriptor: int) -> bool:
    """True if systemd has connected a file descriptor of this process with its journal."""
    status = os.fstat(descriptor)
    return environment.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"


def send(fields: Mapping[str, str], address: str = SOCKET) -> None:
    """Writes one entry; the message alone to standard error, which is the journal as well, if the socket takes none."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as client:
            client.sendto(b"".join(_encoded(name, value.encode()) for name, value in fields.items()), address)
    except OSError:
        print(fields["MESSAGE"], file=sys.stderr, flush=True)


def _encoded(name: str, value: bytes) -> bytes:
    # The native protocol: a value of several lines comes with its length.
    if b"\n" not in value:
        return name.encode() + b"=" + value + b"\n"
    return name.encode() + b"\n" + len(value).to_bytes(8, "little") + value + b"\n"
