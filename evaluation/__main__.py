"""Command line of the evaluation: runs experiments and writes a report of each.

  python -m evaluation geometries            one experiment in full
  python -m evaluation geometries --quick    the same in seconds, on fewer and shorter sequences
  python -m evaluation peers trust           several, and one report of them
  python -m evaluation all --quick           every experiment
  python -m evaluation list                  names and titles of the experiments
  python -m evaluation recordings --data D   an experiment on recordings that are not in the repository
  python -m evaluation geometries --set frames=100 --set seeds=1    changed settings

Writes OUT/EXPERIMENT/report.html with tables and pictures, and report.json with the same numbers; of several
experiments also OUT/report.html and OUT/report.json with the goals, tables and pictures of all. Equal seeds give equal
numbers, except for measured times.

The exit code is 0 if all experiments ran, 1 if a required goal is missed, 2 if an experiment cannot run here. Other
missed goals are printed and leave the exit code unchanged; --json lists all goals. An experiment that lacks data or
packages is skipped, with a message; for `all` this leaves the exit code unchanged.
"""

import argparse
import json
import pkgutil
import sys
import time
import tomllib
from collections.abc import Sequence
from dataclasses import asdict, fields, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from rich.console import Console

from abs_service.report import page, provenance
from abs_service.report.content import Report, to_json
from abs_service.supervision.exit_codes import Exit, is_for_user
from evaluation import experiment
from evaluation.joint_report import joined

#: Packages of `evaluation` whose modules with a TITLE are experiments.
GROUPS = ("paper", "inputs", "method", "calibration", "service")


class EvaluateOptionError(Exception):
    """Incompatible options, or the name of no experiment."""


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
    parser.add_argument("experiments", metavar="EXPERIMENT", nargs="+", help="names of experiments, all, or list")
    parser.add_argument(
        "--out", metavar="DIR", type=Path, default=Path("results"), help="folder for the reports (default: results)"
    )
    parser.add_argument(
        "--quick", action="store_true", help="seconds instead of minutes, on fewer and shorter sequences"
    )
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="of all random numbers (default: 0)")
    parser.add_argument("--data", metavar="DIR", type=Path, help="recordings that are not in the repository")
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], help="a setting of the experiment, as in TOML"
    )
    parser.add_argument(
        "--json", action="store_true", help="verdicts and numbers as JSON, one line for each experiment"
    )


def run(arguments: argparse.Namespace) -> int:
    """Runs the experiments, writes their reports and prints their goals."""
    known = available()
    if "list" in arguments.experiments:
        print("\n".join(f"{name:<18} {known[name].TITLE}" for name in known))
        return Exit.OK
    takes_all = "all" in arguments.experiments
    selected = list(known if takes_all else dict.fromkeys(arguments.experiments))
    _check(arguments, selected, known)
    made: dict[str, Report] = {}
    missing: dict[str, str] = {}
    for name in selected:
        try:
            made[name] = _measure(name, known[name], arguments)
        except experiment.UnavailableError as error:
            missing[name] = f"not run: {error}"
            print(f"{name}: skipped: {error}", file=sys.stderr)
            continue
        _print(made[name], name, page.write(made[name], _folder(arguments.out, name) / "report"), arguments.json)
    if len(selected) > 1 and made:
        joint = joined(made, missing, _origin(arguments.experiments, arguments))
        written = page.write(joint, arguments.out / "report")
        print(f"All of them: {written[0]}", file=sys.stderr if arguments.json else sys.stdout)
    worst = max((report.exit_code or Exit.OK for report in made.values()), default=Exit.OK)
    return worst if takes_all or not missing else Exit.USER


def available() -> dict[str, Any]:
    """Experiments by name, sorted; imports all modules of all groups."""
    found = {}
    for group in GROUPS:
        package = import_module(f"evaluation.{group}")
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            candidate = import_module(module.name)
            if hasattr(candidate, "TITLE"):
                found[module.name.rpartition(".")[2]] = candidate
    return dict(sorted(found.items()))


def _check(arguments: argparse.Namespace, selected: Sequence[str], known: dict[str, Any]) -> None:
    if unknown := [name for name in selected if name not in known]:
        titles = "\n".join(f"  {name:<18} {one.TITLE}" for name, one in known.items())
        raise EvaluateOptionError(f'there is no experiment "{unknown[0]}"; available are all and:\n{titles}')
    if arguments.set and len(selected) > 1:
        raise EvaluateOptionError("--set changes the settings of one experiment and cannot be used with several")
    if arguments.data is not None and not arguments.data.is_dir():
        raise EvaluateOptionError(f"--data {arguments.data}: there is no such folder")


def _settings(defaults: Any, changes: Sequence[str]) -> Any:
    """An experiment's settings with some of them changed."""
    values, known = {}, {field.name: type(getattr(defaults, field.name)) for field in fields(defaults)}
    for change in changes:
        key = change.partition("=")[0].strip()
        try:
            value = tomllib.loads(change)[key]
        except (tomllib.TOMLDecodeError, KeyError) as error:
            raise EvaluateOptionError(f"--set {change}: must be KEY=VALUE, such as frames=100") from error
        if key not in known:
            raise EvaluateOptionError(f"--set {change}: there is no such setting; there are: {', '.join(known)}")
        values[key] = tuple(value) if isinstance(value, list) else value
        if not isinstance(values[key], known[key]):
            raise EvaluateOptionError(
                f"--set {change}: must be {known[key].__name__}, as in {getattr(defaults, key)!r}"
            )
    return replace(defaults, **values)


def _folder(out: Path, name: str) -> Path:
    try:
        (out / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise EvaluateOptionError(f"--out {out}: cannot be created: {error.strerror}") from error
    return out / name


def _origin(names: Sequence[str], arguments: argparse.Namespace) -> provenance.Provenance:
    """Provenance of a report of these experiments."""
    words = [*names, *(["--quick"] if arguments.quick else []), "--seed", str(arguments.seed)]
    words += ["--data", str(arguments.data)] if arguments.data is not None else []
    words += [word for pair in arguments.set for word in ("--set", pair)]
    return provenance.trace([*words, "--out", str(arguments.out)], [], program="python -m evaluation")


def _measure(name: str, chosen: Any, arguments: argparse.Namespace) -> Report:
    """Runs one experiment."""
    origin = _origin([name], arguments)
    settings = _settings(chosen.QUICK if arguments.quick else chosen.Settings(), arguments.set)
    start_s = time.monotonic()
    with Console(stderr=True).status(name) as status:
        context = experiment.Context(arguments.seed, arguments.data, lambda text: status.update(f"{name}: {text}"))
        findings = chosen.run(settings, context)
    conditions = {
        "commit": provenance.commit(Path(__file__).parent) or "unknown",
        "seed": arguments.seed,
        "settings": asdict(settings),
        "seconds": round(time.monotonic() - start_s, 1),
    }
    title = f"{chosen.TITLE} (quick)" if arguments.quick else chosen.TITLE
    return experiment.report(title, findings, conditions, origin)


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
