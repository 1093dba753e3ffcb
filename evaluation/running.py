"""Experiments are found, run alone or beside each other, and reported."""

import argparse
import pkgutil
import time
import tomllib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, fields, replace
from functools import partial
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from types import ModuleType
from typing import Any

from rich.console import Console

from abs_service.report import provenance
from abs_service.report.content import Report
from evaluation import experiment

#: Packages of `evaluation` whose modules with a TITLE are experiments.
GROUPS = ("paper", "inputs", "method", "calibration", "service")


class EvaluateOptionError(Exception):
    """Incompatible options, or the name of no experiment."""


def available() -> dict[str, ModuleType]:
    """Experiments by name, sorted."""
    experiments = (one for group in GROUPS for one in _experiments(import_module(f"evaluation.{group}")))
    return dict(sorted((one.__name__.rpartition(".")[2], one) for one in experiments))


def _experiments(package: ModuleType) -> Iterator[ModuleType]:
    """Modules with a TITLE; the parts of one are not imported here, they may need packages that are not installed."""
    for found in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
        module = import_module(found.name)
        if hasattr(module, "TITLE"):
            yield module
        elif found.ispkg:
            yield from _experiments(module)


def group(module: ModuleType) -> str:
    """Name of the group of an experiment."""
    return module.__name__.split(".")[1]


@contextmanager
def started(names: Sequence[str], arguments: argparse.Namespace) -> Iterator[dict[str, Callable[[], Report]]]:
    """A function for each experiment that returns its report: it runs here, or has begun in a process beside others."""
    labels = {name: f"{number} of {len(names)}, {name}" for number, name in enumerate(names, start=1)}
    if arguments.jobs == 1:
        yield {name: partial(measure, name, label, arguments) for name, label in labels.items()}
        return
    with ProcessPoolExecutor(arguments.jobs, get_context("spawn")) as processes:
        yield {name: processes.submit(measure, name, label, arguments).result for name, label in labels.items()}


def measure(name: str, label: str, arguments: argparse.Namespace) -> Report:
    """Runs one experiment; `label` names it while it runs."""
    chosen = available()[name]
    traced = origin([name], arguments)
    settings = _settings(chosen.QUICK if arguments.quick else chosen.Settings(), arguments.set)
    start_s = time.monotonic()
    with Console(stderr=True).status(label) as status:
        context = experiment.Context(arguments.seed, arguments.data, lambda text: status.update(f"{label}: {text}"))
        findings = chosen.run(settings, context)
    conditions = {
        "commit": provenance.commit(Path(__file__).parent) or "unknown",
        "seed": arguments.seed,
        "settings": asdict(settings),
        "seconds": round(time.monotonic() - start_s, 1),
    }
    title = f"{chosen.TITLE} (quick)" if arguments.quick else chosen.TITLE
    return experiment.report(title, findings, conditions, traced)


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
        value = float(value) if known[key] is float and type(value) is int else value
        values[key] = tuple(value) if isinstance(value, list) else value
        if not isinstance(values[key], known[key]):
            raise EvaluateOptionError(
                f"--set {change}: must be {known[key].__name__}, as in {getattr(defaults, key)!r}"
            )
        if type(value) is int and value < 0:
            raise EvaluateOptionError(f"--set {change}: counts something; must be 0 or more")
    return replace(defaults, **values)


def origin(names: Sequence[str], arguments: argparse.Namespace) -> provenance.Provenance:
    """Provenance of a report of these experiments."""
    words = [*names, *(["--quick"] if arguments.quick else []), "--seed", str(arguments.seed)]
    words += ["--data", str(arguments.data)] if arguments.data is not None else []
    words += [word for pair in arguments.set for word in ("--set", pair)]
    return provenance.trace([*words, "--out", str(arguments.out)], [], program="python -m evaluation")
