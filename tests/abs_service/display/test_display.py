import io
import json
from pathlib import Path

import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health
from rich.console import Console
from rich.spinner import Spinner

from abs_service.display.terminal.lines import JsonDisplay, PlainDisplay, line
from abs_service.display.terminal.table import TableDisplay, draw
from abs_service.supervision.rig_state import RigState
from abs_service.supervision.rig_view import RigView, size
from abs_service.supervision.supervisor import Child, State
from abs_service.tracking.log.sensor_shares import SensorShares
from abs_service.tracking.log.tracker_log import EstimateReport
from tests.abs_service.supervision.idle_process import Idle

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


@pytest.fixture
def live():
    """A rig in full swing: two seconds of health, one estimate."""
    clock = Clock()
    live = RigState(["sheet"], clock)
    for second in range(2):
        clock.now_ns += S
        take_health(live, capture(30 * second))
        take_health(live, recorder(second * 2_000_000))
        take_health(live, Health(component="track/sheet", level=Health.LEVEL_OK, labels={"phase": "tracking"}))
    tracker = live.trackers["sheet"]
    tracker.last, tracker.estimates, tracker.skipped = report(), 12, 3
    tracker.statuses["TRACKING"] = 12
    tracker.exposure_ns = {"tof": clock.now_ns - 50_000_000}
    for total, value in ((tracker.error_mm, 2.345), (tracker.surface_mm, 0.987), (tracker.solve_ms, 17.3)):
        total.add(value)
    return live


def take_health(live, health):
    from abs_service.bus.contract import Sample

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
        counters={"recorded": 500, "dropped.tof/depth/image": 2, "dropped.color/color/image": 1},
    )


def view(live, **changes):
    children = [Child("capture", (), 0, State.RUNNING), Child("record", (), 1, State.BACKOFF, "ended", restarts=2)]
    children[0].process = Idle()
    fields = {
        "rig": "demo",
        "endpoint": "tcp/127.0.0.1:7447",
        "directory": Path("/takes"),
        "live": live,
        "children": children,
        "elapsed_s": 83.4,
        "now_ns": 102 * S,
        "host_clock": "",
    }
    return RigView(**(fields | changes))


def drawn(view, width=80):
    out = io.StringIO()
    Console(file=out, width=width, height=24, color_system=None).print(draw(view, Spinner("dots")))
    return out.getvalue()


def row(text, begin):
    return next(line.split() for line in text.splitlines() if line.strip().startswith(begin))


def test_what_each_sensor_shows_of_the_vertices_is_in_the_table(live):
    assert "behind" not in drawn(view(live))
    shares = {"tof": SensorShares(0.86, 0.02, 0.07, 0.05, 0.0, 0.0, 0.03, 0.03)}
    shares["color"] = SensorShares(0.9, 0.1, 0.0, 0.0, 0.0, 0.0, None, None)
    live.trackers["sheet"].last = report(shares=shares)
    text = drawn(view(live))
    assert row(text, "vertices")[1:] == ["agree", "off", "missing", "behind", "itself", "outside", "beyond"]
    assert row(text, "sheet tof") == ["sheet", "tof", "86%", "2%", "7%", "5%", "0%", "0%", "3%"]
    assert row(text, "sheet color")[-1] == "–"


def test_streams_show_rate_age_and_losses(live):
    text = drawn(view(live))
    assert row(text, "tof/depth") == ["tof/depth", "30.0", "Hz", "50", "ms", "30", "0"]
    assert row(text, "color/color") == ["color/color", "29.5", "Hz", "–", "30", "4"]
    assert "sim/truth" not in text


def test_trackers_show_what_they_found_and_how_wrong_it_is(live):
    text = drawn(view(live))
    numbers = ["TRACKING", "2.35", "mm", "0.99", "mm", "17.3", "ms", "45", "ms", "20/300", "3"]
    assert row(text, "sheet") == ["sheet", *numbers]
    assert "Θ[48] +0.000 +0.125" in text


def test_reasons_are_shown(live):
    live.trackers["sheet"].last = report(status="LOST", reasons=("only 12% of the vertices agree",), error_mm=None)
    assert "sheet: only 12% of the vertices agree" in drawn(view(live))


def test_the_recorder_shows_its_file_size_rate_and_losses(live):
    assert "recording demo_2026.mcap  2.0 MB  2.0 MB/s  3 dropped" in drawn(view(live))


def test_the_recorder_says_that_nothing_is_tracked_yet(live):
    health = live.health("record")
    health.labels["tracking"] = "nothing is tracked yet"
    take_health(live, health)
    assert "3 dropped  nothing is tracked yet" in drawn(view(live), width=120)
    assert "recording: nothing is tracked yet" in line(view(live))
    health.labels["file"], health.labels["tracking"] = "", "begins when something is tracked"
    take_health(live, health)
    assert "recording begins when something is tracked" in drawn(view(live))


def test_processes_show_their_number_or_state_and_restarts(live):
    assert "processes  capture 4711  record backoff restarted 2×" in drawn(view(live))


@pytest.mark.parametrize("width", [80, 120])
def test_the_table_fits(live, width):
    text = drawn(view(live), width)
    assert all(len(line) <= width for line in text.splitlines())
    assert len(text.splitlines()) <= 14


def test_troubles_of_components_and_children_that_were_given_up_are_shown(live):
    take_health(
        live, Health(component="capture", level=Health.LEVEL_ERROR, message="sim: unplugged; trying again in 1 s")
    )
    failed = Child("track/sheet", (), 1, State.FAILED, "needed more than 5 restarts")
    text = drawn(view(live, children=[failed]), width=120)
    assert "capture: sim: unplugged; trying again in 1 s" in text
    assert "track/sheet: given up: needed more than 5 restarts" in text


def test_preparation_is_shown_with_a_spinner(live):
    take_health(live, Health(component="track/sheet", labels={"phase": "preparing"}))
    assert "Loading kernels" in drawn(view(live))
    labels = {"phase": "preparing", "kernels": "12 of 31, about 9 s"}
    take_health(live, Health(component="track/sheet", labels=labels))
    assert "Compiling kernels for this rig: sheet 12 of 31, about 9 s" in drawn(view(live))


def test_before_the_first_message_the_table_shows_the_stage_of_the_start():
    live = RigState(["sheet"], Clock())
    text = drawn(view(live))
    assert "no images yet" in text
    assert "Starting the processes" in text
    assert view(live).recording is None


def test_markup_in_what_others_say_is_only_text(live):
    take_health(live, Health(component="capture", level=Health.LEVEL_ERROR, message="[red]odd[/blue]"))
    live.trackers["sheet"].last = report(reasons=("[/] [bold",))
    text = drawn(view(live))
    assert "[red]odd[/blue]" in text
    assert "[/] [bold" in text


def test_the_table_leaves_notes_above_and_the_summary_below(live):
    out = io.StringIO()
    with TableDisplay(Console(file=out, width=100, force_terminal=False)) as display:
        display.update(view(live))
        display.note("capture: [odd] camera found")
        display.estimate(report())
        display.close(view(live))
    text = out.getvalue()
    assert "capture: [odd] camera found" in text
    assert "vertex error mean 2.35 mm" in text


def test_the_summary_lists_images_estimates_errors_losses_file_and_restarts(live, tmp_path):
    (tmp_path / "demo_2026.mcap").touch()
    assert view(live, directory=tmp_path).summary() == [
        "83.4 s, 60 images, 4 dropped",
        "sheet: 12 estimates, 3 frame sets skipped, 17.3 ms each, 12 TRACKING",
        "sheet: vertex error mean 2.35 mm, max 2.35 mm; surface error mean 0.99 mm, max 0.99 mm",
        f"{tmp_path}/demo_2026.mcap: 2.0 MB, 500 messages, 3 dropped",
        "restarts: record 2",
    ]


def test_the_summary_says_what_there_is_of_a_recording_that_failed(live, tmp_path):
    failed = recorder(2_000_000)
    failed.counters["failures"], failed.labels["last_failure"] = 2, "No space left on device"
    take_health(live, failed)
    assert f"{tmp_path}/demo_2026.mcap (is gone): 2.0 MB" in "\n".join(view(live, directory=tmp_path).summary())
    (tmp_path / "demo_2026.mcap.active").touch()
    summary = "\n".join(view(live, directory=tmp_path).summary())
    assert f"{tmp_path}/demo_2026.mcap.active (unfinished: `abs-service recover` completes it): 2.0 MB" in summary
    assert "recording failed 2×, last: No space left on device" in summary


def test_a_file_name_from_the_network_stays_in_the_folder_and_the_forecast_is_shown(live):
    odd = recorder(2_000_000)
    odd.labels["file"], odd.labels["forecast"] = "../../etc/passwd", "2.6 days on this disk"
    take_health(live, odd)
    assert (shown := view(live).recording)
    assert shown.file == Path("/takes/passwd")
    assert "2.6 days on this disk" in drawn(view(live), width=120)


def test_plain_output_is_one_line_a_second(live):
    out = io.StringIO()
    with PlainDisplay(out, io.StringIO()) as display:
        for tenth in range(25):
            display.update(view(live, now_ns=S + tenth * S // 10))
    assert len(out.getvalue().splitlines()) == 3


def test_a_plain_line_shows_the_whole_state(live):
    text = line(view(live))
    for part in ("tof/depth 30.0 Hz", "sheet TRACKING error 2.35 mm, surface 0.99 mm", "12 estimates", "3 dropped"):
        assert part in text


def test_json_is_one_object_per_estimate_and_nothing_else():
    out, notes = io.StringIO(), io.StringIO()
    with JsonDisplay(out, notes) as display:
        display.estimate(report())
        display.note("something")
        display.update(view(RigState(["sheet"], Clock())))
        display.estimate(report(error_mm=None, surface_mm=None))
        display.close(view(RigState(["sheet"], Clock())))
    first, second = map(json.loads, out.getvalue().splitlines())
    assert first == report().as_dict() | {"theta": list(report().theta), "reasons": [], "warnings": []}
    assert second["error_mm"] is None
    assert notes.getvalue().startswith("something\n")


def test_every_status_of_the_wire_has_a_colour():
    from abs_service.display.terminal import table

    names = {name.removeprefix("STATUS_") for name in dict(DeformationState.Status.items())}
    assert names - {"UNSPECIFIED"} == table.STATUS_COLORS.keys()


@pytest.mark.parametrize(
    ("number", "text"), [(0, "0 B"), (999, "999 B"), (1500, "1.5 kB"), (2.5e6, "2.5 MB"), (4e9, "4.00 GB")]
)
def test_sizes(number, text):
    assert size(number) == text
