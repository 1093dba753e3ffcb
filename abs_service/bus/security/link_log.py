"""Lines of the log about who connects to a router with mutual TLS, and with which name."""

import logging

import zenoh

from abs_service.bus.security import roles
from drivers.contract.text import printable

_log = logging.getLogger(__name__)


def on_event(event: zenoh.LinkEvent) -> None:
    """Takes an event of `links.watch`."""
    name, address = printable(event.link.auth_identifier or ""), event.link.dst
    if event.kind == zenoh.SampleKind.DELETE:
        _log.info("%s disconnected: %s", name, address)
    elif name in roles.NAMES:
        _log.info("%s connected: %s", name, address)
    else:
        _log.warning('may do nothing: "%s" at %s; certificates are called %s', name, address, ", ".join(roles.NAMES))
