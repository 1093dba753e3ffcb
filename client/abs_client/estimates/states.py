"""The newest estimate of a tracker, or that there is none."""

from collections.abc import Callable
from dataclasses import replace
from time import monotonic_ns

from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology

from abs_client.connection.link import Link
from abs_client.connection.received import Received, decoded
from abs_client.connection.wake import Wake
from abs_client.errors import RangeError
from abs_client.estimates import feeds
from abs_client.estimates.ages import Ages
from abs_client.estimates.assembly import Assembly
from abs_client.estimates.feeds import Feed
from abs_client.estimates.state import State, Status, received
from abs_client.stream import Stream

#: Pause between two questions for a topology [ns].
PAUSE_NS = 200_000_000
#: Time in place of an endless one, 30 years: what waits cannot wait for ever [s].
FOREVER_S = 1e9

_NOTHING = State(DeformationState(), DeformedMesh(), MeshTopology(), Status.STALE, (), float("nan"))


def states(
    link: Link,
    tracker: str,
    maximum_age_s: float,
    close: Callable[[], None] | None = None,
    feed: Feed = feeds.whole,
) -> Stream[State]:
    """The estimates of a tracker, the newest first and only.

    Args:
        link: to the rig.
        tracker: its name.
        maximum_age_s: older estimates are left out; when there are no others for so long, a STALE one is given.
        close: what ends the link, if the stream is all that uses it.
        feed: what is received of the tracker.

    Raises:
        RangeError: `maximum_age_s` is not greater than 0.
    """
    wake = Wake()
    source = StateSource(link, tracker, checked_age(maximum_age_s), feed, wake, monotonic_ns)
    return Stream(source, wake, link, close or source.close)


def checked_age(maximum_age_s: float) -> float:
    """Returns the largest age of estimates [s] if it can be one.

    Raises:
        RangeError: it cannot.
    """
    if not maximum_age_s > 0.0:  # NaN is not
        raise RangeError(f"maximum_age_s is {maximum_age_s:g}: it must be greater than 0")
    return maximum_age_s


class StateSource:
    """Joins what arrives of a tracker and judges its age; see `stream.Source`.

    Args:
        link, tracker, maximum_age_s, feed: see `states`.
        wake: signalled when there may be a state.
        clock: this host's monotonic clock [ns].
    """

    def __init__(
        self, link: Link, tracker: str, maximum_age_s: float, feed: Feed, wake: Wake, clock: Callable[[], int]
    ) -> None:
        self._link = link
        self._tracker = tracker
        self._wake = wake
        self._clock = clock
        self._maximum_age_s = maximum_age_s
        self._assembly = Assembly(clock)
        self._ages = Ages(clock, self._ask_clock)
        self._last, self._arrived_ns = _NOTHING, 0
        self._stale_ns = self._silent_at_ns()
        self._skipped = 0
        # What receives holds neither the source nor the link, so that both end with their stream.
        handlers = {topic: _signalling(handler, wake) for topic, handler in feed(self._assembly).items()}
        self._subscriptions = [link.subscribe(f"{tracker}/{topic}", one) for topic, one in handlers.items()]
        self._on_topology = handlers["topology"]
        self._requested_ns = clock()
        self._living: set[str] = set()
        link.ask_living(_keys_into(self._living))
        link.ask(f"{tracker}/topology", self._on_topology)  # there is one already, most often

    @property
    def skipped(self) -> int:
        """See `stream.Source`."""
        return self._skipped

    def take(self) -> State | None:
        """The newest estimate, or a STALE one after every `maximum_age_s` without."""
        self._ask_for_topology()
        if (whole := self._assembly.take()) is not None:
            age_s = self._ages.age_s(whole.state, whole.arrived_ns)
            newest, self._arrived_ns = received(whole.state, whole.mesh, whole.topology, age_s), whole.arrived_ns
            self._count_between(self._last.message.header, newest.message.header)
            self._last = newest
            if age_s <= self._maximum_age_s:
                self._stale_ns = self._silent_at_ns()
                return self._last
            self._skipped += 1
        if self._clock() < self._stale_ns:
            return None
        self._stale_ns = self._silent_at_ns()
        return self._stale()

    def due_s(self) -> float:
        """See `stream.Source`."""
        return max((self._stale_ns - self._clock()) * 1e-9, 0.0)

    def close(self) -> None:
        """Stops receiving."""
        for end in self._subscriptions:
            end()

    def _silent_at_ns(self) -> int:
        return self._clock() + round(min(self._maximum_age_s, FOREVER_S) * 1e9)

    def _count_between(self, before: Header, newest: Header) -> None:
        if before.boot_id == newest.boot_id:
            self._skipped += newest.seq - before.seq - 1

    def _stale(self) -> State:
        if self._last is _NOTHING:
            return replace(_NOTHING, reasons=(self._nothing(),))
        age_s = self._ages.age_s(self._last.message, self._arrived_ns)
        return replace(
            self._last, status=Status.STALE, reasons=(f"the newest estimate is {age_s:.1f} s old",), age_s=age_s
        )

    def _nothing(self) -> str:
        """Reason for no estimate so far, with the trackers that live, if this one does not: its name may be wrong."""
        reason = f"nothing was received of tracker {self._tracker} of rig {self._link.rig} yet"
        living = set(self._living)  # answers come in another thread
        self._link.ask_living(_keys_into(self._living))  # for the next time
        if not living or self._link.key(f"live/track/{self._tracker}") in living:
            return reason
        names = (key.split("/") for key in sorted(living))
        return f"{reason}; there are {', '.join(f'{parts[-1]} of rig {parts[1]}' for parts in names)}"

    def _ask_for_topology(self) -> None:
        if self._assembly.lacks_topology and self._clock() - self._requested_ns > PAUSE_NS:
            self._requested_ns = self._clock()
            self._link.ask(f"{self._tracker}/topology", self._on_topology)

    def _ask_clock(self, host_clock: str) -> None:
        ages = self._ages
        self._link.ask(f"clock/{host_clock}", lambda one: ages.add(decoded(Header, one)))


def _signalling(handler: Callable[[Received], None], wake: Wake) -> Callable[[Received], None]:
    def on_message(one: Received) -> None:
        handler(one)
        wake.signal()

    return on_message


def _keys_into(living: set[str]) -> Callable[[Received], None]:
    return lambda one: living.add(one.key)
