"""A web server for one rig: a page, the names of its trackers, and their estimates as server-sent events."""

import json
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources

from abs_client.connection.link import Link, checked
from abs_client.errors import ClientError, UnknownNameError
from abs_client.estimates import states
from abs_client.estimates.state import State
from abs_client.stream import Stream
from abs_client.web.events import events

_PREFIX = "/states/"


class EstimateServer(ThreadingHTTPServer):
    """Serves until `shutdown`; each reader has a thread and gets what is newest when it has read the last.

    Args:
        address: host and port; port 0 for a free one.
        link: to the rig.
        maximum_age_s: older estimates are left out; after as long without one, readers get a STALE one.
        origin: of pages elsewhere that may read, such as `http://localhost:3000`; "" for none.
    """

    daemon_threads = True

    def __init__(self, address: tuple[str, int], link: Link, maximum_age_s: float, origin: str = "") -> None:
        self._link = link
        self._maximum_age_s = maximum_age_s
        self.origin = origin
        super().__init__(address, _Reader)

    def trackers(self) -> list[str]:
        """Names of the trackers that live."""
        return sorted(self._link.trackers())

    def estimates(self, tracker: str) -> Stream[State]:
        """The estimates of a tracker; they end when the link is closed."""
        return states.states(self._link, tracker, self._maximum_age_s)


class _Reader(BaseHTTPRequestHandler):
    server: EstimateServer  # pyright: ignore[reportIncompatibleVariableOverride]
    timeout = 10.0  # one that asks nothing or reads nothing for so long is let go, since each keeps a thread [s]

    def do_GET(self) -> None:
        try:
            self._answer()
        except UnknownNameError as error:
            self.send_error(HTTPStatus.NOT_FOUND, explain=str(error))
        except ClientError as error:
            self.send_error(HTTPStatus.BAD_GATEWAY, explain=str(error))
        except OSError:
            self.close_connection = True  # the reader is gone

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 the name in the base class
        """Suppresses the log of requests."""

    def _answer(self) -> None:
        if self.path == "/":
            self._whole(
                "text/html; charset=utf-8", resources.files("abs_client.web").joinpath("page.html").read_bytes()
            )
        elif self.path == "/trackers":
            self._whole("application/json", json.dumps(self.server.trackers()).encode())
        elif self.path.startswith(_PREFIX):
            with self.server.estimates(checked(self.path.removeprefix(_PREFIX))) as stream:
                self._head("text/event-stream")
                for event in events(stream):
                    self.wfile.write(event)
        else:
            self.send_error(HTTPStatus.NOT_FOUND, explain="there are /, /trackers and /states/TRACKER")

    def _whole(self, kind: str, content: bytes) -> None:
        self._head(kind)
        self.wfile.write(content)

    def _head(self, kind: str) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        if self.server.origin:
            self.send_header("Access-Control-Allow-Origin", self.server.origin)
        self.end_headers()
