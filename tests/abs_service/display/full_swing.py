"""A rig in full swing, as the displays see it."""

from pathlib import Path

from absmsg.v1.health_pb2 import Health

from abs_service.bus.contract import Sample
from abs_service.supervision.children.child import Child, ChildState
from abs_service.supervision.health.rig_view import RigPlaces, RigView
from abs_service.tracking.log.tracker_log import EstimateReport
from tests.abs_service.supervision.children.idle_process import Idle

S = 1_000_000_000


def report(**changes):
    return EstimateReport(
        **{
            "tracker": "sheet",
            "seq": 41,
            "stamp": "2026-01-02T03:04:05.250Z",
            "status": "TRACKING",
            "reasons": (),
            "warnings": (),
            "theta": tuple(0.125 * i for i in range(48)),
            "error_mm": 2.345,
            "surface_mm": 0.987,
            "vertex_sigma_mm": 2.5,
            "solve_ms": 17.3,
            "age_ms": 45.2,
            "generations": 20,
            "evaluations": 300,
            "skipped": 1,
        }
        | changes
    )


class Clock:
    now_ns = 100 * S

    def __call__(self):
        return self.now_ns


def take_health(live, health):
    live.take(Sample(f"health/{health.component}", Health.DESCRIPTOR.full_name, health.SerializeToString()))


def capture(frames, **changes):
    counters = {
        "published.tof/depth/image": frames,
        "published.color/color/image": frames,
        "published.sim/truth": frames,
    }
    counters["dropped.color/color/image"] = 4
    gauges = {"rate_hz.tof/depth/image": 29.97, "rate_hz.color/color/image": 29.5}
    return Health(component="capture", level=Health.LEVEL_OK, counters=counters, gauges=gauges, **changes)


def recorder(file_bytes):
    return Health(
        component="record",
        level=Health.LEVEL_OK,
        labels={"file": "demo_2026.mcap.active"},
        gauges={"file_bytes": file_bytes},
        counters={"files": 1, "recorded": 500, "dropped.tof/depth/image": 2, "dropped.color/color/image": 1},
    )


def view(live, **changes):
    children = [
        Child("capture", (), 0, ChildState.RUNNING),
        Child("record", (), 1, ChildState.BACKOFF, "ended", restarts=2),
    ]
    children[0].process = Idle()
    fields = {
        "rig": RigPlaces("demo", "tcp/127.0.0.1:7447", Path("/takes")),
        "live": live,
        "children": children,
        "elapsed_s": 83.4,
        "now_ns": 102 * S,
        "host_clock": "",
    }
    return RigView(**(fields | changes))
