"""Warns before a certificate ends: a process may run for months, and cannot connect again after that."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from functools import partial

from abs_service.bus.security.mutual_tls import Certificate, MutualTls, NoSecurity, TlsError

#: Time before the end of a certificate from which on it is warned of.
ENDS = timedelta(days=30)
#: Time between two checks of the files [ns].
PERIOD_NS = 600 * 10**9
#: What is left to do for a router.
RENEWED = "a new one is in its place, for which this process has to be started again"


def warning(own: Certificate | None) -> str:
    """Warning that a certificate ends soon or has ended; "" if its end is far away, or if there is none."""
    left = own.ends - datetime.now(UTC) if own else ENDS
    if own is None or left >= ENDS:
        return ""
    ends = "ends" if left > timedelta() else "has ended"
    return f'the certificate "{own.name}" {ends} on {own.ends.date()}; after that, nobody can connect'


class Expiry:
    """Repeats the check of a running process's certificate, and warns before it ends.

    zenoh reads the files of a client whenever it connects, so that new ones in their place are enough; those of a
    router only when it starts.

    Args:
        security: its files, which were right when it started.
        endpoint: of the router.
        listens: whether this process is the router.
        clock: CLOCK_MONOTONIC [ns].
    """

    def __init__(
        self, security: NoSecurity | MutualTls, endpoint: str, listens: bool, clock: Callable[[], int]
    ) -> None:
        self._check, self._listens, self._clock = partial(security.check, endpoint, listens), listens, clock
        self._own = self._found = self._check()
        self._next_ns = clock() + PERIOD_NS

    def trouble(self) -> str:
        """The warning, or what is wrong with a client's files by now; "" if nothing is."""
        if self._clock() >= self._next_ns:
            try:
                self._found = self._check()
            except TlsError as error:
                if not self._listens:  # a router goes on with those that it has read
                    return str(error)  # looked at each time, until it is mended
            self._next_ns = self._clock() + PERIOD_NS
        if not self._listens:
            self._own = self._found
        text, own, found = warning(self._own), self._own, self._found
        return f"{text}; {RENEWED}" if text and own and found and found.ends > own.ends else text
