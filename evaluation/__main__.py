"""Measures how well it all works: the experiments of the paper and more, each with a report.

  python -m evaluation geometries --out results            one experiment, in full
  python -m evaluation geometries --out results --quick    the same in seconds, with fewer and shorter sequences
  python -m evaluation all --out results --quick           every experiment
  python -m evaluation list                                what experiments there are
  python -m evaluation recordings --out results --data D   one that needs recordings which are not part of the program
  python -m evaluation geometries --out results --set frames=100 --set seeds=1    with other settings than its own

Writes OUT/EXPERIMENT/report.html with tables and pictures, and report.json with the same numbers. Equal seeds give
equal numbers, but for measured times.

The exit code is 0 if all ran, 1 if a required goal is missed, 2 if an experiment cannot run here. A goal that is missed
without being required is said, and changes no exit code; --json tells all of them. `all` passes over an experiment that
lacks data or packages, and says so.
"""

import argparse
import json
import os
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

from abs_service.cli import THREADS
from abs_service.report import page, provenance
from abs_service.report.content import Report, to_json
from abs_service.supervision.exit_codes import Exit, is_for_user
from evaluation import experiments
from evaluation.experiments import base


class EvaluateOptionError(Exception):
    """Options that do not go together, or a name of no experiment."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the chosen experiments and returns the exit code."""
    for variable in THREADS:
        os.environ.setdefault(variable, "1")
    parser = argparse.ArgumentParser(
        prog="python -m evaluation", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_arguments(parser)
    try:
        return run(parser.parse_args(argv))
    except KeyboardInterrupt:
        return Exit.INTERRUPTED
    except Exception as error:
        if not is_for_user(error):
            raise
        print(f"evaluation: error: {error}", file=sys.stderr)
        return Exit.USER


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments."""
    parser.add_argument("experiment", metavar="EXPERIMENT", help="name of an experiment, all, or list")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder for the reports")
    parser.add_argument(
        "--quick", action="store_true", help="seconds instead of minutes, on fewer and shorter sequences"
    )
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="of everything random (default: 0)")
    parser.add_argument("--data", metavar="DIR", type=Path, help="recordings that are not part of the program")
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="append", default=[], help="a setting of the experiment, as in TOML"
    )
    parser.add_argument(
        "--json", action="store_true", help="verdicts and numbers as JSON, one line for each experiment"
    )


def run(arguments: argparse.Namespace) -> int:
    """Runs the experiments, writes their reports and says whether the goals are met."""
    known = available()
    if arguments.experiment == "list":
        print("\n".join(f"{name:<14} {known[name].TITLE}" for name in known))
        return Exit.OK
    chosen = list(known) if arguments.experiment == "all" else [arguments.experiment]
    _check(arguments, chosen, known)
    worst = Exit.OK
    for name in chosen:
        try:
            made = _measure(name, known[name], arguments)
        except base.UnavailableError as error:
            if arguments.experiment != "all":
                raise
            print(f"{name}: passed over: {error}", file=sys.stderr)
            continue
        _say(made, name, page.write(made, _folder(arguments.out, name) / "report"), arguments.json)
        worst = max(worst, made.exit_code or Exit.OK)
    return worst


def available() -> dict[str, Any]:
    """The experiments by name; imports all of them."""
    names = sorted(module.name for module in pkgutil.iter_modules(experiments.__path__))
    modules = {name: import_module(f"{experiments.__name__}.{name}") for name in names}
    return {name: module for name, module in modules.items() if hasattr(module, "TITLE")}


def _check(arguments: argparse.Namespace, chosen: Sequence[str], known: dict[str, Any]) -> None:
    if unknown := [name for name in chosen if name not in known]:
        titles = "\n".join(f"  {name:<14} {experiment.TITLE}" for name, experiment in known.items())
        raise EvaluateOptionError(f'there is no experiment "{unknown[0]}"; there are, and all:\n{titles}')
    if arguments.out is None:
        raise EvaluateOptionError("--out DIR is needed: the folder that the reports go to")
    if arguments.set and arguments.experiment == "all":
        raise EvaluateOptionError("--set changes one experiment's settings; all have settings of their own")
    if arguments.data is not None and not arguments.data.is_dir():
        raise EvaluateOptionError(f"--data {arguments.data}: there is no such folder")


def _settings(usual: Any, changes: Sequence[str]) -> Any:
    """An experiment's settings with some of them changed."""
    values, known = {}, {field.name: type(getattr(usual, field.name)) for field in fields(usual)}
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
            raise EvaluateOptionError(f"--set {change}: must be {known[key].__name__}, as in {getattr(usual, key)!r}")
    return replace(usual, **values)


def _folder(out: Path, name: str) -> Path:
    try:
        (out / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise EvaluateOptionError(f"--out {out}: cannot be made: {error.strerror}") from error
    return out / name


def _measure(name: str, experiment: Any, arguments: argparse.Namespace) -> Report:
    """Runs one experiment."""
    said = ["evaluate", name, *(["--quick"] if arguments.quick else []), "--seed", str(arguments.seed)]
    said += ["--data", str(arguments.data)] if arguments.data is not None else []
    said += [word for pair in arguments.set for word in ("--set", pair)]
    trace = provenance.trace([*said, "--out", str(arguments.out)], [])
    settings = _settings(experiment.QUICK if arguments.quick else experiment.Settings(), arguments.set)
    begun = time.monotonic()
    with Console(stderr=True).status(name) as status:
        context = base.Context(arguments.seed, arguments.data, lambda text: status.update(f"{name}: {text}"))
        findings = experiment.run(settings, context)
    made = {
        "commit": provenance.commit(Path(experiments.__path__[0])) or "unknown",
        "seed": arguments.seed,
        "settings": asdict(settings),
        "seconds": round(time.monotonic() - begun, 1),
    }
    title = f"{experiment.TITLE} (quick)" if arguments.quick else experiment.TITLE
    return base.report(title, findings, made, trace)


def _say(made: Report, name: str, written: Sequence[Path], as_json: bool) -> None:
    if as_json:
        content = to_json(made)
        kept = {key: content[key] for key in ("title", "verdict", "verdicts", "values")}
        print(json.dumps({"experiment": name, **kept, "report": str(written[0])}, ensure_ascii=False))
        return
    print(f"{made.title}, {made.values['seconds']:g} s")
    for verdict in made.verdicts:
        advice = f" {verdict.advice}" if verdict.advice else ""
        print(f"  {page.MARKS[verdict.level]} {base.GOALS.words[verdict.level]}: {verdict.text}{advice}")
    print(f"  {written[0]}")


if __name__ == "__main__":
    sys.exit(main())
