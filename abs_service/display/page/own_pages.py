"""Keeps pages of other sites, which a browser on this host may have open as well, from the server of the live page."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

from websockets.asyncio import server
from websockets.http11 import Request, Response

#: What a browser calls this host. Another name in its place is one that its owner has led here (DNS rebinding).
NAMES = frozenset({"127.0.0.1", "localhost", "::1"})


def is_own(host: str, origin: str) -> bool:
    """True for a request of this host's own page, or of no page.

    Args:
        host: what the request calls the server, `Host`.
        origin: page that it comes from, `Origin`; "" from programs other than browsers, and where a page is opened.
    """
    try:
        return urlsplit(f"//{host}").hostname in NAMES and (not origin or urlsplit(origin).netloc == host)
    except ValueError:  # no address
        return False


@contextmanager
def own_pages_only() -> Iterator[None]:
    """Context in which new servers of websockets answer own pages only; browsers leave that to the server."""
    serve = server.serve

    def serve_own(*args: Any, process_request: Callable[[Any, Request], Response | None], **options: Any) -> Any:
        def answer(connection: server.ServerConnection, request: Request) -> Response | None:
            if is_own(request.headers.get("Host", ""), request.headers.get("Origin", "")):
                return process_request(connection, request)
            return connection.respond(HTTPStatus.FORBIDDEN, "This page can be opened on its own host only.\n")

        return serve(*args, process_request=answer, **options)

    server.serve = serve_own
    try:
        yield
    finally:
        server.serve = serve
