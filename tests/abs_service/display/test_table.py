"""The table on the terminal shows the whole rig, and fits."""

import io
from pathlib import Path

import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health
from rich.console import Console
from rich.spinner import Spinner

from abs_service.display.terminal.lines import line
from abs_service.display.terminal.output import Output
from abs_service.display.terminal.table import STATUS_COLORS, TableDisplay, draw
from abs_service.supervision.children.child import Child, ChildState
from abs_service.supervision.health.rig_state import RigState
from abs_service.tracking.log.sensor_shares import SensorShares
from tests.abs_service.display.full_swing import Clock, recorder, report, take_health, view


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


def test_the_last_estimate_of_a_silent_tracker_is_not_shown_as_the_present_one(live):
    live.trackers["sheet"].last = report(shares={"tof": SensorShares(0.86, 0.02, 0.07, 0.05, 0.0, 0.0, 0.03, 0.03)})
    silent = view(live, silent={"sheet": "no estimate for 9 s"})
    for text in (drawn(silent), line(silent)):
        assert "sheet: no estimate for 9 s" in text.replace("sheet no", "sheet: no")
        assert not {"TRACKING", "86%", "2.35"} & set(text.split())


def test_a_stream_has_no_rate_once_its_process_has_ended(live):
    ended = view(live, children=[Child("capture", (), 0, ChildState.BACKOFF, "ended by signal 9")])
    assert row(drawn(ended), "tof/depth")[1:3] == ["0.0", "Hz"]


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


def test_the_whole_line_of_the_recorder_is_shown_in_a_narrow_terminal(live):
    health = live.health("record")
    health.labels["forecast"] = "17 days on this disk"
    health.labels["file"] = "demo_2026-11-27T22-02-49Z.mcap.active"
    health.labels["tracking"] = "nothing is tracked yet"
    take_health(live, health)
    text = " ".join(drawn(view(live), width=60).split())
    assert "3 dropped nothing is tracked yet 17 days on this disk" in text


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
    failed = Child("track/sheet", (), 1, ChildState.FAILED, "needed more than 5 restarts")
    waits = Child("record", (), 2, reason="cannot be started: Too many open files", lacks=True)
    text = drawn(view(live, children=[failed, waits]), width=120)
    assert "capture: sim: unplugged; trying again in 1 s" in text
    assert "track/sheet: given up: needed more than 5 restarts" in text
    assert "record: cannot be started: Too many open files" in text


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
    with (
        Output(out.write) as file,
        TableDisplay(Console(file=file.file, width=100), file) as display,
    ):
        display.update(view(live))
        display.note("capture: [odd] camera found")
        display.estimate(report())
        display.close(view(live))
    text = out.getvalue()
    assert "capture: [odd] camera found" in text
    assert "vertex error mean 2.35 mm" in text


def test_every_status_of_the_wire_has_a_colour():
    names = {name.removeprefix("STATUS_") for name in dict(DeformationState.Status.items())}
    assert names - {"UNSPECIFIED"} == STATUS_COLORS.keys()


def test_a_file_name_from_the_network_stays_in_the_folder_and_the_forecast_is_shown(live):
    odd = recorder(2_000_000)
    odd.labels["file"], odd.labels["forecast"] = "../../etc/passwd", "2.6 days on this disk"
    take_health(live, odd)
    assert (shown := view(live).recording)
    assert shown.file == Path("/takes/passwd")
    assert "2.6 days on this disk" in drawn(view(live), width=120)


def test_how_long_the_disk_lasts_is_not_told_before_there_are_images():
    live, waiting = RigState(["sheet"], Clock()), recorder(50_000)
    waiting.labels["forecast"] = "211.6 days on this disk"
    take_health(live, waiting)
    assert (shown := view(live).recording)
    assert shown.forecast == ""
