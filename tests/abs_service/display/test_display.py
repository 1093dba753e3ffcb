"""Lines and JSON for terminals without a table, and the summary at the end."""

import io
import json
import os
import threading

import pytest
from absmsg.v1.health_pb2 import Health
from rich.console import Console

from abs_service.display.terminal import output
from abs_service.display.terminal.lines import JsonDisplay, PlainDisplay, line
from abs_service.display.terminal.output import Output
from abs_service.display.terminal.table import TableDisplay
from abs_service.supervision.health.rig_state import RigState
from abs_service.supervision.health.rig_view import RigPlaces, size
from tests.abs_service.display.full_swing import Clock, S, recorder, report, take_health, view


def test_the_summary_lists_images_estimates_errors_losses_file_and_restarts(live, tmp_path):
    (tmp_path / "demo_2026.mcap").touch()
    assert view(live, rig=RigPlaces("demo", directory=tmp_path)).summary() == [
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
    assert f"{tmp_path}/demo_2026.mcap (is gone): 2.0 MB" in "\n".join(
        view(live, rig=RigPlaces("demo", directory=tmp_path)).summary()
    )
    (tmp_path / "demo_2026.mcap.active").touch()
    summary = "\n".join(view(live, rig=RigPlaces("demo", directory=tmp_path)).summary())
    assert f"{tmp_path}/demo_2026.mcap.active (unfinished: `abs-service recover` completes it): 2.0 MB" in summary
    assert "recording failed 2×, last: No space left on device" in summary


def test_the_summary_tells_what_did_not_come_to_a_tracker(live):
    take_health(live, Health(component="track/sheet", counters={"lost.tof/depth/image": 180, "lost.tof/amplitude": 1}))
    assert "sheet: 181 images were lost on their way to it" in view(live).summary()


def test_the_summary_counts_all_processes_of_a_component_that_was_started_again(live, tmp_path):
    again = recorder(1_000_000)
    again.header.boot_id = "another process"
    take_health(live, again)
    take_health(live, again)  # once a second
    assert (
        view(live, rig=RigPlaces("demo", directory=tmp_path))
        .summary()[3]
        .endswith("1.0 MB; 2 files, 1000 messages, 6 dropped")
    )


def test_two_living_processes_of_a_component_are_counted_once_each(live, tmp_path):
    other, own = recorder(1_000_000), live.health("record")
    other.header.boot_id = "another host"
    for _ in range(5):  # once a second, in turn
        take_health(live, other)
        take_health(live, own)
    assert (
        view(live, rig=RigPlaces("demo", directory=tmp_path)).summary()[3].endswith("2 files, 1000 messages, 6 dropped")
    )


def test_the_processes_of_months_are_counted_and_few_are_kept(live):
    for number in range(100):
        again = recorder(1_000_000)
        again.header.boot_id = f"process {number}"
        take_health(live, again)
    assert live.counters("record")["recorded"] == 101 * 500


def test_plain_output_is_one_line_a_second(live):
    out = io.StringIO()
    with Output(out.write) as file, PlainDisplay(file, Output(io.StringIO().write)) as display:
        for tenth in range(25):
            display.update(view(live, now_ns=S + tenth * S // 10))
    assert len(out.getvalue().splitlines()) == 3


def test_a_plain_line_shows_the_whole_state(live):
    text = line(view(live))
    for part in ("tof/depth 30.0 Hz", "sheet TRACKING error 2.35 mm, surface 0.99 mm", "12 estimates", "3 dropped"):
        assert part in text


def test_json_is_one_object_per_estimate_and_nothing_else():
    out, notes = io.StringIO(), io.StringIO()
    with Output(notes.write) as said, JsonDisplay(Output(out.write), said) as display:
        display.estimate(report())
        display.note("something")
        display.update(view(RigState(["sheet"], Clock())))
        display.estimate(report(error_mm=None, surface_mm=None))
        display.close(view(RigState(["sheet"], Clock())))
    first, second = map(json.loads, out.getvalue().splitlines())
    assert first == report().as_dict() | {"theta": list(report().theta), "reasons": [], "warnings": []}
    assert second["error_mm"] is None
    assert notes.getvalue().startswith("something\n")


@pytest.mark.parametrize(
    ("number", "text"), [(0, "0 B"), (999, "999 B"), (1500, "1.5 kB"), (2.5e6, "2.5 MB"), (4e9, "4.00 GB")]
)
def test_sizes(number, text):
    assert size(number) == text


@pytest.mark.parametrize("kind", [PlainDisplay, JsonDisplay])
def test_an_output_on_a_full_disk_does_not_end_the_rig_and_says_what_is_missing(live, kind):
    notes = io.StringIO()
    with open("/dev/full", "w", encoding="utf-8") as full, Output(notes.write) as said:
        display = kind(output.of(full), said)
        display.update(view(live))
        display.estimate(report())
        assert display.close(view(live)) > 0
    assert "lines of output are missing: No space left on device" in notes.getvalue()


@pytest.mark.parametrize("kind", [PlainDisplay, JsonDisplay])
def test_notes_that_nobody_can_read_do_not_end_the_rig(kind):
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "w", encoding="utf-8") as nobody, output.of(nobody) as notes:
        display = kind(Output(io.StringIO().write), notes)
        display.note("record ended by signal 9")
        with pytest.raises(BrokenPipeError):
            notes.finish()
        display.note("record ended by signal 9")


def test_nobody_waits_for_a_reader_that_stands_still_and_what_it_misses_is_counted(monkeypatch):
    monkeypatch.setattr(output, "END_S", 0.01)
    reader, writer = os.pipe()
    with open(reader, "rb"), open(writer, "w", encoding="utf-8") as pipe, output.of(pipe) as halted:
        for number in range(output.DEPTH + 200):
            halted.write(f"{number:<1000}\n")
        missing = halted.finish()
        assert not halted.idle
        assert f"up to {halted.lost} lines of output are missing: its reader stands still" == missing
        assert output.DEPTH < halted.lost < output.DEPTH + 200


def test_a_halted_terminal_is_given_no_further_tables_but_all_notes(live):
    go_on, written = threading.Event(), []

    def write(text):
        go_on.wait(5.0)
        written.append(text)

    with Output(write) as halted:
        display = TableDisplay(Console(file=halted.file, force_terminal=True, width=100), halted)
        for second in range(9):
            display.update(view(live, now_ns=second * S))
        display.note("capture: camera found")
        go_on.set()
        halted.finish()
    assert len(written) == 2
    assert "camera found" in written[-1]
