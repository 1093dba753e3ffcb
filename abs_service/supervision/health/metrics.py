"""Metrics of a running rig for Prometheus, on loopback: rates, ages, losses by cause, status, restarts, disk."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from abs_service.supervision.health.rig_view import RigView
from drivers.contract.errors import install_extra

if TYPE_CHECKING:
    from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

#: Period in which the numbers are taken [ns]; health comes as often.
PERIOD_NS = 1_000_000_000

#: Time that who connects has for a request [s]; each keeps a thread meanwhile.
IDLE_S = 10.0

_STATUSES = ("INITIALIZING", "TRACKING", "DEGRADED", "LOST")

#: A number, its name and meaning, and the values of its labels.
Row = tuple[str, str, dict[str, str], float]


class MetricsError(Exception):
    """The metrics cannot be served; the message names the key, its value and the remedy."""


@contextmanager
def served(port: int) -> Iterator[Callable[[RigView], None]]:
    """Serves the views given to the yielded function, at http://127.0.0.1:`port`/metrics; nothing if `port` is 0.

    Raises:
        MetricsError: the extra `metrics` is not installed, or the port is in use.
    """
    if not port:
        yield _ignore
        return
    try:
        from prometheus_client import CollectorRegistry, start_http_server  # noqa: PLC0415 - an extra
    except ImportError as error:
        missing = f"run.metrics_port = {port}: needs prometheus-client: {install_extra('metrics')} in the clone"
        raise MetricsError(missing) from error
    snapshot, registry = _Snapshot(), CollectorRegistry()
    registry.register(snapshot)
    server: Any  # whose handler of requests is typed as a function
    try:
        server, thread = start_http_server(port, "127.0.0.1", registry)
    except OSError as error:
        raise MetricsError(f"run.metrics_port = {port}: {error.strerror}; choose another port, or 0") from error
    server.RequestHandlerClass.timeout = IDLE_S
    server.handle_error = _ignore_error  # who says nothing, or nonsense, is no error of the rig
    try:
        yield snapshot.update
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Snapshot:
    """The latest numbers: taken in the thread of the rig, read by those of the server."""

    def __init__(self) -> None:
        self._rows: Sequence[Row] = ()
        self._next_ns = 0

    def update(self, view: RigView) -> None:
        """Takes the numbers if the period is over."""
        if view.now_ns >= self._next_ns:
            self._next_ns = view.now_ns + PERIOD_NS
            self._rows = [
                (name, text, {"rig": view.rig.name, **labels}, value) for name, text, labels, value in rows(view)
            ]

    def collect(self) -> "Iterator[CounterMetricFamily | GaugeMetricFamily]":
        """Called by prometheus-client for each request."""
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily  # noqa: PLC0415 - an extra

        families: dict[str, CounterMetricFamily | GaugeMetricFamily] = {}
        for name, text, labels, value in self._rows:
            kind = CounterMetricFamily if name.endswith("_total") else GaugeMetricFamily
            family = families.setdefault(name, kind(name, text, labels=list(labels)))
            family.add_metric(list(labels.values()), value)
        yield from families.values()


def rows(view: RigView) -> Iterator[Row]:
    """All numbers of a rig. Losses are in `abs_count_total`, named as in docs/reference/reliability.md."""
    yield from _of_components(view)
    for stream in view.streams:
        yield "abs_stream_rate_hertz", "rate of a stream of images", {"stream": stream.name}, stream.rate_hz
        if stream.age_ms is not None:
            age = {"stream": stream.name}
            yield "abs_stream_age_seconds", "age of the image last tracked", age, stream.age_ms * 1e-3
    for name, log in view.live.trackers.items():
        tracker = {"tracker": name}
        yield "abs_estimates_total", "estimates of a tracker", tracker, log.estimates
        if log.last is None:
            continue
        for status in _STATUSES:
            labels, present = tracker | {"status": status}, log.last.status == status and name not in view.silent
            yield "abs_tracker_status", "1 for the status of the last estimate; 0 for all without", labels, present
        yield "abs_solve_seconds", "duration of the last search", tracker, log.last.solve_ms * 1e-3
        if log.last.age_ms is not None:
            age_s = log.last.age_ms * 1e-3
            yield (
                "abs_estimate_age_seconds",
                "from the exposure to the publication of the last estimate",
                tracker,
                age_s,
            )
    for child in view.children:
        yield "abs_restarts_total", "restarts of a process", {"component": child.component}, child.restarts


def _of_components(view: RigView) -> Iterator[Row]:
    for component, received in view.live.received.items():
        labels = {"component": component}
        yield "abs_health_level", "1: OK, 2: WARNING, 3: ERROR", labels, received.health.level
        age_s = (view.now_ns - received.t_ns) * 1e-9
        yield "abs_health_age_seconds", "time since the last health, sent every second", labels, age_s
        for name, number in received.health.counters.items():
            yield "abs_count_total", "counters of health, by name", labels | {"name": name}, number
        for name, value in view.gauges(component).items():
            if math.isfinite(value):
                yield "abs_gauge", "gauges of health, by name, which ends in the unit", labels | {"name": name}, value
    if "free_bytes" in (gauges := view.gauges("record")):
        yield "abs_disk_free_bytes", "room on the disk of the recordings", {}, gauges["free_bytes"]


def _ignore(view: RigView) -> None:
    pass


def _ignore_error(request: object, client: object) -> None:
    pass
