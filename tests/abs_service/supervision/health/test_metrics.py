"""Metrics as Prometheus's own parser reads them; and errors that prevent them."""

import socket
import sys
import threading
import urllib.error
import urllib.request
from dataclasses import replace

import pytest
from absmsg.v1.health_pb2 import Health

from abs_service.bus.contract import Sample
from abs_service.supervision.children.child import Child, ChildState
from abs_service.supervision.health import metrics
from abs_service.supervision.health.rig_state import RigState
from abs_service.supervision.health.rig_view import RigPlaces, RigView
from abs_service.tracking.log.tracker_log import EstimateReport

S = 1_000_000_000
NOW_NS = 100 * S


def view(now_ns=NOW_NS, **capture):
    """A rig with one tracker, a recorder that was started twice, and the health of its devices as given."""
    live = RigState(["sheet"], lambda: NOW_NS)
    for health in (
        Health(component="capture", level=Health.LEVEL_OK, **capture),
        Health(component="record", level=Health.LEVEL_WARNING, gauges={"free_bytes": 5e9}),
    ):
        live.take(Sample(f"health/{health.component}", Health.DESCRIPTOR.full_name, health.SerializeToString()))
    log = live.trackers["sheet"]
    log.estimates = 12
    log.last = EstimateReport("sheet", 1, "", "DEGRADED", (), (), (), None, None, None, 8.0, 20.0, 1, 1, 0)
    log.exposure_ns = {"tof": NOW_NS - S // 4}
    children = [Child("record", (), 1, ChildState.RUNNING, restarts=2)]
    return RigView(RigPlaces("demo"), live, children, 1.0, now_ns, "")


@pytest.fixture
def read(port):
    """Reads all numbers by name and labels, as Prometheus does."""
    parser = pytest.importorskip("prometheus_client.parser", reason="needs the extra metrics")

    def read():
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5) as answer:
            text = answer.read().decode()
        found = [sample for family in parser.text_string_to_metric_families(text) for sample in family.samples]
        return {
            (sample.name, *(f"{key}={value}" for key, value in sorted(sample.labels.items()))): sample.value
            for sample in found
        }

    return read


def test_prometheus_reads_rates_ages_losses_status_restarts_and_disk(read, port):
    with metrics.served(port) as update:
        assert read() == {}
        counters = {"published.tof/depth/image": 30, "dropped.tof/depth/image": 4}
        update(
            view(counters=counters, gauges={"rate_hz.tof/depth/image": 29.5, "device.sim.temperature_c": float("nan")})
        )
        found = read()
    assert found == {
        ("abs_health_level", "component=capture", "rig=demo"): 1,
        ("abs_health_level", "component=record", "rig=demo"): 2,
        ("abs_health_age_seconds", "component=capture", "rig=demo"): 0,
        ("abs_health_age_seconds", "component=record", "rig=demo"): 0,
        ("abs_count_total", "component=capture", "name=published.tof/depth/image", "rig=demo"): 30,
        ("abs_count_total", "component=capture", "name=dropped.tof/depth/image", "rig=demo"): 4,
        ("abs_gauge", "component=capture", "name=rate_hz.tof/depth/image", "rig=demo"): 29.5,
        ("abs_gauge", "component=record", "name=free_bytes", "rig=demo"): 5e9,
        ("abs_stream_rate_hertz", "rig=demo", "stream=tof/depth"): 29.5,
        ("abs_stream_age_seconds", "rig=demo", "stream=tof/depth"): 0.25,
        ("abs_estimates_total", "rig=demo", "tracker=sheet"): 12,
        **{("abs_tracker_status", "rig=demo", f"status={status}", "tracker=sheet"): float(status == "DEGRADED")
           for status in ("INITIALIZING", "TRACKING", "DEGRADED", "LOST")},
        ("abs_solve_seconds", "rig=demo", "tracker=sheet"): 0.008,
        ("abs_estimate_age_seconds", "rig=demo", "tracker=sheet"): 0.02,
        ("abs_restarts_total", "component=record", "rig=demo"): 2,
        ("abs_disk_free_bytes", "rig=demo"): 5e9,
    }  # fmt: skip


def test_numbers_are_taken_once_a_second(read, port):
    key = ("abs_count_total", "component=capture", "name=frames", "rig=demo")
    with metrics.served(port) as update:
        update(view(counters={"frames": 1}))
        update(view(NOW_NS + S // 2, counters={"frames": 2}))
        assert read()[key] == 1
        update(view(NOW_NS + S, counters={"frames": 3}))
        assert read()[key] == 3


def test_a_process_that_says_nothing_any_more_has_counters_and_an_age_but_no_present_numbers(read, port):
    capture = {"counters": {"published.tof/depth/image": 30}, "gauges": {"rate_hz.tof/depth/image": 29.5}}
    with metrics.served(port) as update:
        update(view(NOW_NS + 6 * S, **capture))
        found = read()
    assert found["abs_stream_rate_hertz", "rig=demo", "stream=tof/depth"] == 0
    assert found["abs_health_age_seconds", "component=capture", "rig=demo"] == 6
    assert found["abs_count_total", "component=capture", "name=published.tof/depth/image", "rig=demo"] == 30
    assert {name for name, *_ in found}.isdisjoint({"abs_gauge", "abs_disk_free_bytes"})


def test_a_tracker_without_estimates_has_no_status(read, port):
    with metrics.served(port) as update:
        update(replace(view(), silent={"sheet": "no estimate for 9 s"}))
        found = read()
    assert {value for (name, *_), value in found.items() if name == "abs_tracker_status"} == {0.0}


def test_only_loopback_is_answered_and_nobody_after_the_end(read, port):
    with metrics.served(port):
        assert read() == {}
        # An address of this host which a server for all addresses would answer.
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.2", port), 5)
    with pytest.raises(urllib.error.URLError):
        read()


def test_who_says_nothing_is_let_go_without_a_word(read, port, monkeypatch, capfd):
    monkeypatch.setattr(metrics, "IDLE_S", 0.2)
    with metrics.served(port), socket.create_connection(("127.0.0.1", port), 5) as idle:
        assert read() == {}
        assert idle.recv(1) == b"", "closed"
    assert capfd.readouterr().err == ""


def test_a_port_in_use_is_named(read, port):
    with (
        metrics.served(port),
        pytest.raises(metrics.MetricsError, match=rf"run.metrics_port = {port}: Address already"),
        metrics.served(port),
    ):
        pass


def test_the_missing_extra_is_named(monkeypatch, port):
    monkeypatch.setitem(sys.modules, "prometheus_client", None)
    with pytest.raises(metrics.MetricsError, match=r"'\.\[metrics\]'"), metrics.served(port):
        pass


def test_none_by_default(monkeypatch):
    monkeypatch.setitem(sys.modules, "prometheus_client", None)  # the extra is not needed then
    before = threading.enumerate()
    with metrics.served(0) as update:
        update(view())
        assert threading.enumerate() == before
