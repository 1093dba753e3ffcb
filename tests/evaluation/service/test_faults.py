"""The experiments `faults` and `soak`: what they make of what was seen, and the table in docs/reference."""

import json
import math
from pathlib import Path
from unittest.mock import Mock

import pytest

from abs_service.report.content import to_json
from abs_service.report.provenance import trace
from evaluation import experiment
from evaluation.experiment import UnavailableError
from evaluation.service import faults, soak
from evaluation.service.faults import page, running
from evaluation.service.faults.fault import Elsewhere, Fault, Made, Seen, Try, gap_s
from evaluation.service.faults.report import row
from evaluation.service.faults.running import RunningRig
from evaluation.service.faults.table import FAULTS
from evaluation.service.soak import Usage, growth, lost_images

S = 1_000_000_000
ROOT = Path(__file__).parents[3]
FAULT = next(one for one in FAULTS if isinstance(one, Fault))
WELL = Try(0.5, "run: capture ended", 1.0, 0.4, 0.4, 1.0, "")


def test_the_page_has_a_row_for_each_fault():
    lines = page.PAGE.read_text(encoding="utf-8").partition(page.BEGIN)[2].partition(page.END)[0].splitlines()
    assert [page.name(line) for line in lines if page.name(line) not in {"", "fault"}] == [
        one.name for one in FAULTS
    ], "docs/reference/reliability.md lacks a fault: make faults"


def test_names_are_unique_and_tests_exist():
    assert len({one.name for one in FAULTS}) == len(FAULTS)
    assert all((ROOT / one.test).exists() for one in FAULTS if isinstance(one, Elsewhere))


@pytest.mark.parametrize(
    ("seen", "words"),
    [
        (WELL, ""),
        (Try(math.nan, "", 1.0, 0.4, 0.4, 1.0, ""), "not in health"),
        (Try(2.5, "", 1.0, 0.4, 0.4, 1.0, ""), "in health after 2.5 s"),
        (Try(0.5, "", math.nan, 0.4, 0.4, 1.0, ""), "did not recover"),
        (
            Try(0.5, "", 1.0, 9.0, math.inf, 1.0, "exit code 1"),
            "exit code 1, no estimate for 9.0 s, no recording for inf s",
        ),
    ],
)
def test_each_broken_promise_is_named(seen, words):
    assert seen.missed(FAULT) == words


def test_a_rig_that_cannot_be_listened_to_is_ended_and_disturbs_no_further_fault(tmp_path, monkeypatch):
    def refuse(*_):
        raise TimeoutError

    monkeypatch.setattr(running, "Listener", refuse)
    service = Mock()
    with pytest.raises(TimeoutError):
        RunningRig(tmp_path, running.table(""), lambda _: service, frozenset())
    service.stop.assert_called_once_with()


def test_a_rig_that_is_started_again_has_to_track_soon():
    restarted = next(one for one in FAULTS if one.name == "kill -9 of `run`, started again")
    assert isinstance(restarted, Fault)
    assert Try(math.nan, "", 6.0, 9.0, 9.0, 3.5, "").missed(restarted) == "tracks after 3.5 s"


@pytest.mark.parametrize(
    ("times", "gap"),
    [([0, 10, 20, 30], 10.0), ([0, 10, 30, 31], 20.0), ([0, 50], 50.0), ([0, 90, 91], 90.0), ([0], math.inf)],
)
def test_a_gap_is_that_which_touches_the_time_of_the_fault(times, gap):
    assert gap_s([t * S for t in times], 12 * S, 25 * S) == gap


@pytest.mark.parametrize(
    ("error", "outcome", "missed"),
    [
        (UnavailableError("mount: no"), "not permitted here: mount: no", 0),
        (TimeoutError("no calm"), "MISSED: no calm", 2),
    ],
)
def test_a_fault_that_cannot_be_tried_does_not_end_the_others(monkeypatch, error, outcome, missed):
    def refuse(*_):
        raise error

    monkeypatch.setattr(faults, "make_tries", refuse)
    found = faults.run(faults.Settings(2, ("kill -9 of `track`",)), experiment.Context(0))
    assert [(row["outcome"], row["missed"]) for row in found.values["rows"]] == [(outcome, missed)]


def test_reports_become_rows_and_other_rows_stay():
    found = faults.findings([row(FAULT, [WELL, Try(0.5, "", 7.0, 9.0, 0.4, 1.0, "")])])
    assert not found.goals[0].met
    values = json.loads(json.dumps(to_json(experiment.report("", found, {}, trace([], [])))))["values"]["rows"]
    other = "| kill -9 of `track` | x | 10 | kept | 1 | 1 | 1 | 1 |"
    text = f"before\n{page.BEGIN}\n{other}\n| gone | x |\n{page.END}\nafter"
    new = page.rewritten(text, [page.Row.from_values(one) for one in values])
    assert f"| {FAULT.name} | {FAULT.promise} | 2 | MISSED in 1: no estimate for 9.0 s | 9.0 | 0.4 | 0.5 | 7.0 |" in new
    assert other in new
    assert "gone" not in new
    assert page.rewritten(new, []) == new


def test_images_are_lost_that_no_fault_explains():
    frames = [(t * S, t, 0, t) for t in range(20)]
    seen = Seen(Made(10 * S, 11 * S), 12 * S, True)
    assert lost_images(frames, {t for t in range(20) if t not in {9, 12}}, [seen]) == 0
    assert lost_images(frames, {t for t in range(20) if t not in {8, 12, 13}}, [seen]) == 2


def test_what_grows_is_seen():
    usages = [Usage(t * S, "run", 10**8 + 10**4 * t, 20) for t in range(600)]
    memory, files = growth(usages)["run"]
    assert memory == pytest.approx(0.6)
    assert files == pytest.approx(0.0, abs=1e-9)


def test_a_soak_says_what_was_late_and_ill():
    late, ill = Try(2.5, "", 1.0, 0.4, 0.4, 1.0, ""), Try(0.5, "", math.nan, 0.4, 0.4, 1.0, "")
    usages = [Usage(t * S, "run", 10**8, 20) for t in range(600)]
    found = soak.findings(soak.Settings(), [(FAULT, WELL), (FAULT, late), (FAULT, ill)], 0, usages)
    assert [goal.met for goal in found.goals] == [True, False, False, True, True]
    assert found.values["held"] == {"run": "100 → 100 MB, 20 → 20 files"}


def test_the_soak_makes_only_faults_after_which_the_rig_helps_itself():
    assert {one.name for one in soak.FAULTS} >= {FAULT.name, "the folder is renamed"}
    assert not any("started again" in one.name or one.room_mb for one in soak.FAULTS)


@pytest.mark.slow
def test_a_killed_tracker_is_seen_by_a_real_listener():
    settings = faults.Settings(tries=1, only=("kill -9 of `track`",))
    (found,) = faults.run(settings, experiment.Context(0)).values["rows"]
    assert found["tries"] == 1
    assert 0 < found["noticed_s"] < 10
    assert 0.2 < found["estimates_s"] < 20
    assert "track" in found["said"]
