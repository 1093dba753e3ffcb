"""Command line of the evaluation: runs experiments and writes a report of each.

  python -m evaluation geometries            one experiment in full
  python -m evaluation geometries --quick    the same in seconds, on fewer and shorter sequences
  python -m evaluation peers trust           several, and one report of them
  python -m evaluation all --quick           every experiment
  python -m evaluation paper method          every experiment of two groups
  python -m evaluation all --jobs 2          two at a time; measured times are then those of a busy machine
  python -m evaluation list                  names and titles of the experiments
  python -m evaluation recordings --data D   an experiment on recordings that are not in the repository
  python -m evaluation geometries --set frames=100 --set seeds=1    changed settings

Writes OUT/EXPERIMENT/report.html with tables and pictures, and report.json with the same numbers; of several
experiments also OUT/report.html and OUT/report.json with the goals, tables and pictures of all. Equal seeds give equal
numbers, except for measured times.

The exit code is 0 if all experiments ran, 1 if a required goal is missed, 2 if an experiment cannot run here. Other
missed goals are printed and leave the exit code unchanged; --json lists all goals. An experiment that lacks data or
packages is skipped, with a message; for groups and `all` this leaves the exit code unchanged.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from abs_service.commands.parts.options import whole
from abs_service.report import page
from abs_service.report.content import Report, to_json
from abs_service.supervision.exit_codes import Exit, is_for_user
from evaluation import experiment, running
from evaluation.joint_report import joined
from evaluation.running import EvaluateOptionError

_SEED = whole(2**32 - 1, "a whole number")
_JOBS = whole(1000, "a number of experiments", 1)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the selected experiments and returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m evaluation", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_arguments(parser)
    try:
        return run(parser.parse_args(argv))
    except KeyboardInterrupt:
        return Exit.INTERRUPTED
    except Exception as error:
        own = type(error).__module__.partition(".")[0] in ("evaluation", "__main__")
        if not (own or is_for_user(error)):
            raise
        print(f"evaluation: error: {error}", file=sys.stderr)
        return Exit.USER


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments."""
    parser.add_argument(
        "experiments",
        metavar="EXPERIMENT",
        nargs="+",
        help=f"names of experiments, groups ({', '.join(running.GROUPS)}), all, or list",
    )
    parser.add_argument(
        "--out", metavar="DIR", type=Path, default=Path("results"), help="folder for the reports (default: results)"
    )
    parser.add_argument(
        "--quick", action="store_true", help="seconds instead of minutes, on fewer and shorter sequences"
    )
    parser.add_argument("--seed", metavar="N", type=_SEED, default=0, help="of all random numbers (default: 0)")
    parser.add_argument("--data", metavar="DIR", type=Path, help="recordings that are not in the repository")
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], help="a setting of the experiment, as in TOML"
    )
    parser.add_argument(
        "--jobs",
        metavar="N",
        type=_JOBS,
        default=1,
        help="experiments at the same time, which disturbs times (default: 1)",
    )
    parser.add_argument(
        "--json", action="store_true", help="verdicts and numbers as JSON, one line for each experiment"
    )


def run(arguments: argparse.Namespace) -> int:
    """Runs the experiments, writes their reports and prints their goals."""
    known = running.available()
    if "list" in arguments.experiments:
        print("\n".join(f"{name:<18} {known[name].TITLE}" for name in known))
        return Exit.OK
    groups = {group: [name for name in known if running.group(known[name]) == group] for group in running.GROUPS}
    groups["all"] = list(known)
    selected = list(dict.fromkeys(name for one in arguments.experiments for name in groups.get(one, [one])))
    named = [name for name in arguments.experiments if name not in groups]
    _check(arguments, selected, known)
    made: dict[str, Report] = {}
    missing: dict[str, str] = {}
    with running.started(selected, arguments) as measurements:
        for name, measured in measurements.items():
            try:
                made[name] = measured()
            except experiment.UnavailableError as error:
                missing[name] = f"not run: {error}"
                print(f"{name}: skipped: {error}", file=sys.stderr)
                continue
            _print(made[name], name, page.write(made[name], _folder(arguments.out, name) / "report"), arguments.json)
    if len(selected) > 1 and made:
        joint = joined(made, missing, running.origin(arguments.experiments, arguments))
        written = page.write(joint, arguments.out / "report")
        print(f"All of them: {written[0]}", file=sys.stderr if arguments.json else sys.stdout)
    worst = max((report.exit_code or Exit.OK for report in made.values()), default=Exit.OK)
    return Exit.USER if any(name in missing for name in named) else worst


def _check(arguments: argparse.Namespace, selected: Sequence[str], known: dict[str, ModuleType]) -> None:
    if unknown := [name for name in selected if name not in known]:
        titles = "\n".join(f"  {name:<18} {one.TITLE}" for name, one in known.items())
        raise EvaluateOptionError(
            f'there is no experiment "{unknown[0]}"; available are all, {", ".join(running.GROUPS)} and:\n{titles}'
        )
    if arguments.set and len(selected) > 1:
        raise EvaluateOptionError("--set changes the settings of one experiment and cannot be used with several")
    if arguments.data is not None and not arguments.data.is_dir():
        raise EvaluateOptionError(f"--data {arguments.data}: there is no such folder")


def _folder(out: Path, name: str) -> Path:
    try:
        (out / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise EvaluateOptionError(f"--out {out}: cannot be created: {error.strerror}") from error
    return out / name


def _print(report: Report, name: str, written: Sequence[Path], as_json: bool) -> None:
    if as_json:
        content = to_json(report)
        kept = {key: content[key] for key in ("title", "verdict", "verdicts", "values")}
        print(json.dumps({"experiment": name, **kept, "report": str(written[0])}, ensure_ascii=False))
        return
    print(f"{report.title}, {report.values['seconds']:g} s")
    for verdict in report.verdicts:
        advice = f" {verdict.advice}" if verdict.advice else ""
        print(f"  {page.MARKS[verdict.level]} {experiment.GOALS.words[verdict.level]}: {verdict.text}{advice}")
    print(f"  {written[0]}")


if __name__ == "__main__":
    sys.exit(main())
