"""The command `evaluate` and how a goal becomes a verdict, with an experiment of its own."""

import json
import math
import subprocess
import sys
import types
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import pytest

from abs_service.report.content import Column, Level, Section, Table
from abs_service.supervision.exit_codes import Exit
from evaluation import __main__, running
from evaluation.experiment import Context, Findings, UnavailableError, at_least, at_most


@dataclass(frozen=True)
class Settings:
    """Settings of the experiment under test."""

    frames: int = 500
    duration_s: float = 20.0


@pytest.fixture
def experiment(monkeypatch: pytest.MonkeyPatch) -> Callable[..., types.SimpleNamespace]:
    """Makes experiments `good` and, if told to, others by what they do."""
    made: dict[str, object] = {}

    def add(name: str, run: Callable[[Settings, Context], Findings], group: str = "method") -> None:
        made[name] = types.SimpleNamespace(
            __name__=f"evaluation.{group}.{name}", TITLE=f"X: {name}", Settings=Settings, QUICK=Settings(3), run=run
        )

    monkeypatch.setattr(running, "available", lambda: made)
    return add  # type: ignore[return-value]


def found(*values: float, required: bool = False) -> Callable[[Settings, Context], Findings]:
    """An experiment that measures these, each of which should be at least 2."""

    def run(settings: Settings, context: Context) -> Findings:
        table = Table("Draws", (Column("frames"), Column("seed")), ((settings.frames, context.seed),))
        goals = tuple(at_least("Ratio", value, 2.0, required=required) for value in values)
        return Findings(goals, (Section("Evidence", (table,)),), {"ratios": list(values)})

    return run


def unavailable(settings: Settings, context: Context) -> Findings:
    raise UnavailableError("needs --data DIR")


def test_a_report_has_verdicts_numbers_and_how_it_was_made(experiment, tmp_path: Path, capsys) -> None:
    experiment("good", found(2.5, 1.5))
    assert __main__.main(["good", "--out", str(tmp_path), "--quick", "--seed", "7"]) == Exit.OK
    report = json.loads((tmp_path / "good" / "report.json").read_text(encoding="utf-8"))
    assert report["values"] | {"commit": "", "seconds": 0} == {
        "commit": "",
        "seed": 7,
        "settings": {"frames": 3, "duration_s": 20.0},
        "seconds": 0,
        "ratios": [2.5, 1.5],
        "goals": [
            {"name": "Ratio", "value": 2.5, "relation": "≥", "bound": 2.0, "met": True},
            {"name": "Ratio", "value": 1.5, "relation": "≥", "bound": 2.0, "met": False},
        ],
    }
    assert report["verdict"] == "missed"
    assert report["sections"][0]["blocks"][0]["table"]["rows"] == [[3, 7]]
    page = (tmp_path / "good" / "report.html").read_text(encoding="utf-8")
    assert "Not all goals are met." in page
    assert "missed: Ratio: 1.5, goal ≥ 2." in capsys.readouterr().out


def test_only_a_required_goal_that_is_missed_changes_the_exit_code(experiment, tmp_path: Path) -> None:
    experiment("good", found(1.0))
    experiment("required", found(1.0, required=True))
    assert __main__.main(["good", "--out", str(tmp_path)]) == Exit.OK
    assert __main__.main(["all", "--out", str(tmp_path)]) == Exit.FAILED
    assert (tmp_path / "required" / "report.html").exists()


def test_json_is_one_line_for_each_experiment(experiment, tmp_path: Path, capsys) -> None:
    experiment("a", found(3.0))
    experiment("b", found(1.0))
    __main__.main(["all", "--out", str(tmp_path), "--json"])
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [(line["experiment"], line["verdict"]) for line in lines] == [("a", "met"), ("b", "missed")]


def test_the_progress_counts_experiments(experiment, tmp_path: Path, monkeypatch) -> None:
    shown: list[str] = []
    status = nullcontext(types.SimpleNamespace(update=shown.append))
    monkeypatch.setattr(running, "Console", lambda stderr: types.SimpleNamespace(status=lambda label: status))
    for name in ("one", "two"):
        experiment(name, lambda settings, context: context.progress("measuring") or found(2.5)(settings, context))
    assert __main__.main(["one", "two", "--out", str(tmp_path)]) == Exit.OK
    assert shown == ["1 of 2, one: measuring", "2 of 2, two: measuring"]


def test_settings_of_one_experiment_can_be_changed(experiment, tmp_path: Path) -> None:
    experiment("good", found(2.5))
    given = ["good", "--out", str(tmp_path), "--quick", "--set", "frames=40", "--set", "duration_s=5"]
    assert __main__.main(given) == Exit.OK
    report = json.loads((tmp_path / "good" / "report.json").read_text(encoding="utf-8"))
    assert report["values"]["settings"] == {"frames": 40, "duration_s": 5.0}
    assert "--set frames=40" in report["provenance"]["command"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("frames", "KEY=VALUE"),
        ("frames=", "KEY=VALUE"),
        ("shots=3", "there are: frames, duration_s"),
        ("frames='x'", "must be int"),
        ("duration_s=true", "must be float"),
        ("frames=-3", "must be 0 or more"),
    ],
)
def test_settings_that_cannot_be_are_named(experiment, given: str, said: str, tmp_path: Path, capsys) -> None:
    experiment("good", found(2.5))
    assert __main__.main(["good", "--out", str(tmp_path), "--set", given]) == Exit.USER
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("given", [["all"], ["good", "other"]])
def test_all_have_settings_of_their_own(experiment, given: list[str], tmp_path: Path, capsys) -> None:
    experiment("good", found(2.5))
    experiment("other", found(2.5))
    assert __main__.main([*given, "--out", str(tmp_path), "--set", "frames=3"]) == Exit.USER
    assert "--set" in capsys.readouterr().err


def test_an_unknown_experiment_is_answered_with_all_there_are(experiment, tmp_path: Path, capsys) -> None:
    experiment("good", found(2.5))
    assert __main__.main(["god", "--out", str(tmp_path)]) == Exit.USER
    said = capsys.readouterr().err
    assert 'no experiment "god"' in said
    assert "X: good" in said


def test_what_lacks_its_data_is_an_error_alone_and_passed_over_with_others(experiment, tmp_path: Path, capsys) -> None:
    experiment("bare", unavailable)
    experiment("good", found(2.5))
    assert __main__.main(["bare", "--out", str(tmp_path)]) == Exit.USER
    assert __main__.main(["all", "--out", str(tmp_path)]) == Exit.OK
    said = capsys.readouterr()
    assert "bare: skipped: needs --data DIR" in said.err
    assert "X: good" in said.out


def test_several_experiments_make_one_report_with_all_goals(experiment, tmp_path: Path, capsys) -> None:
    experiment("first", found(2.5))
    experiment("second", found(1.5))
    experiment("bare", unavailable)
    assert __main__.main(["second", "first", "--out", str(tmp_path)]) == Exit.OK
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert [(one["about"], one["level"]) for one in report["verdicts"]] == [("second:", "missed"), ("first:", "met")]
    assert [section["title"] for section in report["sections"][1::2]] == ["second: Evidence", "first: Evidence"]
    assert report["values"]["first"]["ratios"] == [2.5]
    assert "second first" in report["provenance"]["command"]
    assert str(tmp_path / "report.html") in capsys.readouterr().out
    assert (tmp_path / "first" / "report.html").exists()


def test_one_that_cannot_run_is_open_in_the_report_of_several(experiment, tmp_path: Path) -> None:
    experiment("good", found(2.5))
    experiment("bare", unavailable)
    assert __main__.main(["bare", "good", "--out", str(tmp_path)]) == Exit.USER
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert report["verdict"] == "open"
    assert (report["verdicts"][-1]["about"], report["verdicts"][-1]["text"]) == ("bare:", "not run: needs --data DIR")


@pytest.mark.parametrize("given", [["--out", "x", "--data", "not a folder"], ["--out", "a file"]])
def test_folders_that_cannot_be_are_named(
    experiment, given: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    experiment("good", found(2.5))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a file").touch()
    assert __main__.main(["good", *given]) == Exit.USER
    assert ("--data" if "--data" in given else "--out") in capsys.readouterr().err


def test_every_experiment_of_the_program_is_complete() -> None:
    for name, one in running.available().items():
        assert running.group(one) in running.GROUPS, name
        assert isinstance(one.QUICK, one.Settings), name
        assert one.TITLE, name
        assert callable(one.run), name
    assert "evaluation.experiment" in sys.modules


def test_experiments_are_found_without_the_packages_of_any_extra() -> None:
    extras = ("av", "depthai", "pyarrow", "rosbags", "trimesh", "usb", "viser")
    hidden = f"import sys; sys.modules.update(dict.fromkeys({extras}))"
    code = f"{hidden}; from evaluation import running; print(*running.available())"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.split() == list(running.available())


def test_a_goal_becomes_a_verdict_with_figure_bound_and_reason() -> None:
    met, missed = at_most("Error", 1.234, 2.0, "mm").verdict(), at_most("Error", 3.0, 2.0, "mm", "Too dark.").verdict()
    assert (met.level, met.text, met.advice) == (Level.GOOD, "Error: 1.23 mm, goal ≤ 2 mm.", "")
    assert (missed.level, missed.advice) == (Level.BAD, "Too dark.")


def test_what_could_not_be_measured_meets_no_goal() -> None:
    for goal in (at_most("Error", math.nan, 2.0), at_least("Ratio", math.nan, 2.0)):
        assert not goal.met
        assert "not measured" in goal.verdict().text


def test_the_header_of_every_experiment_states_goals_and_seeds():
    """Written before the run; see the rules in evaluation/README.md."""
    headers = {name: (one.__doc__ or "").lower() for name, one in running.available().items()}
    assert len(headers) > 10
    assert [name for name, text in headers.items() if "goal" not in text or "seeds" not in text] == []


def test_a_group_is_all_of_its_experiments(experiment, tmp_path: Path) -> None:
    for name in ("first", "second"):
        experiment(name, found(2.5), group="inputs")
    experiment("other", found(2.5))
    assert __main__.main(["second", "inputs", "--out", str(tmp_path)]) == Exit.OK
    assert {path.name for path in tmp_path.iterdir() if path.is_dir()} == {"first", "second"}


@pytest.mark.slow
def test_two_run_beside_each_other_and_find_what_they_find_alone(tmp_path: Path, capsys) -> None:
    chosen = ["--quick", "--seed", "3"]
    with pytest.raises(SystemExit):
        __main__.main(["noise_fits", *chosen, "--jobs", "0"])
    assert "argument --jobs: '0' must be a number of experiments from 1" in capsys.readouterr().err
    assert __main__.main(["noise_fits", "noise_board", *chosen, "--jobs", "2", "--out", str(tmp_path)]) == Exit.OK
    assert (tmp_path / "noise_board/report.json").exists()
    beside = json.loads((tmp_path / "noise_fits/report.json").read_text())
    assert __main__.main(["noise_fits", *chosen, "--out", str(tmp_path / "alone")]) == Exit.OK
    assert json.loads((tmp_path / "alone/noise_fits/report.json").read_text())["verdicts"] == beside["verdicts"]
