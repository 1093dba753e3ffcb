"""Requests of the page to a tracker: detect the object again, in the rig file's region or where the user clicked."""

from collections.abc import Callable
from dataclasses import dataclass

from absmsg.v1.command_pb2 import CommandAnswer
from absmsg.v1.deformation_state_pb2 import DeformationState

from abs_service.bus import keys
from abs_service.display.page.feed import Feed
from abs_service.wire.commands import AS_CONFIGURED, Choice

#: Time that a detection may take [s].
ANSWER_S = 10.0

#: Sends the command to a tracker; returns its answer, None if there is none.
Send = Callable[[str, Choice], CommandAnswer | None]


@dataclass(frozen=True, slots=True)
class _Request:
    """A request: tracker, when [s], version of its mesh before, and the lines that make its choice last."""

    tracker: str
    t_s: float
    version: int
    region: str


class Reinitialization:
    """Requests one detection at a time, and words its result."""

    def __init__(self, feed: Feed, send: Send, say: Callable[[str], None]) -> None:
        self._feed, self._send, self._say = feed, send, say
        self._request: _Request | None = None

    def ask(self, tracker: str, choice: Choice = AS_CONFIGURED) -> None:
        """Asks a tracker to detect its object anew, the one that was chosen."""
        version = self._version(tracker)
        self._say(f"Asks the tracker to detect its object again{choice} …")
        answer = self._send(tracker, choice)
        if answer is None or not answer.accepted:
            self._request = None
            self._say(f"The tracker refuses: {answer.reason if answer else 'it gives no answer'}.")
        else:
            self._request = _Request(tracker, self._feed.now_s, version, answer.region)

    def look(self) -> None:
        """Returns the result of the last request in words, once it is known."""
        request = self._request
        if request is None:
            return
        if (now := self._version(request.tracker)) != request.version:
            advice = "To keep this choice, write into the rig file, in place of its region"
            keep = f"\n\n{advice}:\n```toml\n{request.region}```" if request.region else ""
            self._say(f"New mesh, version {now}.{keep}")
        elif self._feed.now_s - request.t_s > ANSWER_S:
            self._say("No object was found; the tracker goes on as it was.")
        else:
            return
        self._request = None

    def _version(self, tracker: str) -> int:
        found = self._feed.newest(keys.state(tracker), DeformationState)
        return found[0].mesh_version if found else 0
