"""The links of a session: none waits as it is closed, and a client says when its router is gone, and back again."""

import logging
import os
import socket
import stat
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import zenoh

_log = logging.getLogger(__name__)

#: Time in which a router may come back before its client asks for the reason [s].
PATIENCE_S = 5.0

_NO_LINGER = struct.pack("ii", 0, 0)


def watch(session: zenoh.Session, on_event: Callable[[zenoh.LinkEvent], None]) -> Any:
    """Calls a function with each link that begins or ends, until the returned handle is undeclared.

    Nor does a link wait as it is closed from then on: zenoh lets each wait for ten seconds (SO_LINGER) if its peer
    stands still, in the threads that receive and connect, so that six stopped subscribers kept all others from the
    router for a minute. The kernel sends what is left all the same.
    """

    def on_any(event: zenoh.LinkEvent) -> None:
        if event.kind == zenoh.SampleKind.PUT:
            _let_sockets_close()
        on_event(event)

    return session.info.declare_link_events_listener(on_any, history=True)


def _let_sockets_close() -> None:
    """Sets no lingering, the kernel's default, for all sockets of this process: zenoh does not say which is whose."""
    with suppress(OSError):  # no descriptor is left to list them
        for name in os.listdir("/proc/self/fd"):
            with suppress(OSError):  # it is closed meanwhile
                if stat.S_ISSOCK(os.fstat(int(name)).st_mode):
                    with socket.socket(fileno=os.dup(int(name))) as one:
                        one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _NO_LINGER)


class RouterLog:
    """Lines of a client's log about its router.

    Args:
        endpoint: of the router.
        refusal: why a router refuses this process, "" if unknown; see `MutualTls.refusal`.
    """

    def __init__(self, endpoint: str, refusal: Callable[[str], str]) -> None:
        self._endpoint, self._refusal = endpoint, refusal
        self._connected = threading.Event()

    def on_event(self, event: zenoh.LinkEvent) -> None:
        """Takes an event of `watch`."""
        if event.kind == zenoh.SampleKind.PUT:
            self._connected.set()
        else:
            self._connected.clear()
            threading.Thread(target=self._tell, name="router log", daemon=True).start()

    def _tell(self) -> None:
        _log.warning("the connection to %s is lost; it is tried again and again", self._endpoint)
        if not self._connected.wait(PATIENCE_S) and (reason := self._refusal(self._endpoint)):
            _log.warning("%s: %s", self._endpoint, reason)
        self._connected.wait()
        _log.warning("connected to %s again", self._endpoint)
