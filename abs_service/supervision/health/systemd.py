"""Tells systemd how a rig is: ready, alive, and in words (sd_notify, units of `Type=notify` with `WatchdogSec`).

Estimates are what proves life; of a rig without trackers, images. A loop that turns is not: everything may run and
nothing be tracked. Before the first estimate, time to start is asked for again and again, because kernels compile and a
camera may be missing, which no restart brings back. Only this process's hanging ends the start then.
"""

import os
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress

from abs_service.supervision.health.rig_view import RigView

#: Extension of the start that is asked for, four times as often as needed [ns].
EXTENSION_NS = 60_000_000_000
#: Shortest time between two texts for people [ns].
TEXT_PERIOD_NS = 1_000_000_000
#: Longest wait for a systemd that does not read: nothing is supervised meanwhile [s].
TIMEOUT_S = 0.1


class Notifier:
    """Sends the state of a rig to systemd.

    Args:
        send: sends one message.
        watchdog_ns: time without a sign of life after which systemd kills the service; 0: it does not [ns].
    """

    def __init__(self, send: Callable[[str], None], watchdog_ns: int) -> None:
        self._send = send
        self._watchdog_ns = watchdog_ns
        self._ready = False
        self._proven: Mapping[str, int] = {}
        self._proven_ns = self._extended_ns = self._sent_ns = -EXTENSION_NS
        self._text = ""

    def update(self, view: RigView) -> None:
        """Sends changes since the last call, and watchdog messages as often as systemd needs them."""
        self._tell(view)
        counts = _counts(view)
        if not self._ready and all(counts.values()):
            self._ready = True
            self._send("READY=1")
        if self._ready:
            self._feed(counts, view)
        elif view.now_ns - self._extended_ns >= EXTENSION_NS // 4:
            self._extended_ns = view.now_ns
            self._send(f"EXTEND_TIMEOUT_USEC={EXTENSION_NS // 1000}")

    def stopping(self) -> None:
        """Says that the service ends in order."""
        self._send("STOPPING=1")

    def _feed(self, counts: Mapping[str, int], view: RigView) -> None:
        due = self._watchdog_ns and view.now_ns - self._proven_ns >= self._watchdog_ns // 4
        # Each tracker by itself: one that works does not hide another one that does not. One that was started again for
        # another configuration may compile kernels for longer than systemd waits; the supervisor limits that.
        proven = all(
            view.live.prepares(f"track/{name}") or count != self._proven.get(name) for name, count in counts.items()
        )
        # A service that is started anew with a wrong file ends for good; this one goes on when the file is put right.
        if due and (proven or any(child.awaits_correction for child in view.children)):
            self._proven, self._proven_ns = counts, view.now_ns
            self._send("WATCHDOG=1")

    def _tell(self, view: RigView) -> None:
        text = _words(view)
        if text != self._text and view.now_ns - self._sent_ns >= TEXT_PERIOD_NS:
            self._text, self._sent_ns = text, view.now_ns
            self._send(f"STATUS={text}")


def notifier(environment: Mapping[str, str]) -> Notifier:
    """A notifier for the systemd that started this process; one that sends nothing if none did."""
    address = environment.get("NOTIFY_SOCKET", "")
    own = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
    return Notifier(lambda message: _send(address, message), _watchdog_ns(environment) if own else 0)


def _watchdog_ns(environment: Mapping[str, str]) -> int:
    try:
        return max(0, int(environment.get("WATCHDOG_USEC", "0"))) * 1000
    except ValueError:  # it is not systemd's
        return 0


def _send(address: str, message: str) -> None:
    # A lost message is sent again in the next period, or was of no use to systemd.
    path = "\0" + address[1:] if address.startswith("@") else address
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as client:
        if path:
            client.settimeout(TIMEOUT_S)
            client.sendto(message.encode(), path)


def _counts(view: RigView) -> dict[str, int]:
    """Number of estimates of each tracker; of images, if there is no tracker."""
    if view.live.trackers:
        return {name: tracker.estimates for name, tracker in view.live.trackers.items()}
    return {"images": sum(stream.published for stream in view.streams)}


def _words(view: RigView) -> str:
    trackers = [
        f"{name} {'silent' if name in view.silent else log.last.status}"
        for name, log in view.live.trackers.items()
        if log.last is not None
    ]
    troubles = [f"{component}: {message}" for component, _, message in view.troubles]
    states = [view.activity] if view.activity else [*trackers, view.recording.file.name if view.recording else ""]
    return "; ".join(" ".join(part.split()) for part in [*states, *troubles] if part)
