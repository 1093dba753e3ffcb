"""Promises of the repository itself: it works elsewhere, installs what it pins, and its changelog knows the version."""

import ast
import functools
import os
import re
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path
from typing import NamedTuple

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

import abs_service

ROOT = Path(__file__).parents[2]
PACKAGES = ("abs_service", "drivers", "calib")
CONSTRAINTS = ("constraints.txt", "constraints-all.txt")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXTRAS = PROJECT["project"]["optional-dependencies"]
OPTIONAL = [line for extra in EXTRAS.values() for line in extra]

#: Most entries of a folder, and folders that have one entry of each kind and may have more.
MAX_ENTRIES = 14
MARKERS = "__init__.py", "__main__.py", "py.typed"
COLLECTIONS = (
    "abs_service",
    "docs/decisions",
    "docs/how-to",
    "drivers",
    "examples/rigs",
    "proto/absmsg/v1",
    "tests/abs_service",
    "tests/drivers",
)

# Where a path means the same on every Linux machine.
STANDARD = re.compile(r"/(bin|dev|etc|lib|opt|proc|run|sbin|srv|sys|usr|var)/")
ABSOLUTE_PATH = re.compile(r"(?<![\w./:~$}-])(?:/[\w.+-]+){2,}")
#: Images within a drawing.
IMAGE_DATA = re.compile(r"(?<=;base64,)[A-Za-z0-9+/=\s]+")
HOME = re.compile(r"/(home/\w+|root|Users/\w+)/")
PACKAGE_INDEX = re.compile(r"index[-_]url|find[-_]links|trusted[-_]host|\b(pypi|pythonhosted|npmjs)[.](org|com)", re.I)


def test_every_file_is_portable() -> None:
    found = [
        f"{path}:{number}: {complaint}"
        for path, text in _tracked_texts()
        for number, line in enumerate(IMAGE_DATA.sub("", text).splitlines(), start=1)
        for complaint in _not_portable(line)
    ]
    assert found == []


@pytest.mark.parametrize("line", [f"data = '{ROOT}/tests'", "cd /home/" + "ann/code", "pip install --index" + "-url x"])
def test_a_line_that_works_on_one_machine_only_is_noticed(line: str) -> None:
    assert list(_not_portable(line))


@pytest.mark.parametrize("line", ["#!/usr/bin/env bash", "/tof/depth/image", "https://example.org/a/b", "a/b/c"])
def test_a_line_that_works_everywhere_is_left_alone(line: str) -> None:
    assert not list(_not_portable(line))


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("constraints.txt", [*PROJECT["project"]["dependencies"], *PROJECT["dependency-groups"]["build"]]),
        ("constraints-all.txt", [line for line in PROJECT["dependency-groups"]["dev"] if isinstance(line, str)]),
        ("constraints-all.txt", PROJECT["dependency-groups"]["docs"]),
        ("constraints-all.txt", OPTIONAL),
    ],
)
def test_every_requirement_is_pinned_as_asked(name: str, wanted: list[str]) -> None:
    pins = _pins(name)
    assert [line for line in map(Requirement, wanted) if pins[line.name] not in line.specifier] == [], (
        "make constraints"
    )


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_what_a_pinned_package_requires_is_pinned_with_it(name: str) -> None:
    """An installer that insists on hashes accepts nothing less; a list compiled from old metadata may fall short."""
    pins = _pins(name)
    assert {f"{pin} wants {wanted}" for pin in pins for wanted in _requirements(pin) if wanted not in pins} == set()


def test_running_and_testing_use_the_same_versions() -> None:
    assert _pins("constraints.txt").items() <= _pins("constraints-all.txt").items()


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_every_pin_has_a_hash_and_no_address(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    assert all("--hash=sha256:" in pin for pin in re.split(r"\n(?=\w)", text)[1:])
    assert "://" not in text


def test_the_newest_entry_of_the_changelog_is_this_version() -> None:
    headings = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)
    assert headings[0] in {"Unreleased", abs_service.__version__}
    assert abs_service.__version__ in headings


def test_files_and_functions_are_short_enough_to_read_at_once() -> None:
    """Tests as well; only what the compiler of the messages writes may be longer."""
    long = []
    for path, text in _tracked_texts():
        if not path.endswith(".py") or path.endswith("_pb2.py"):
            continue
        if (lines := len(text.splitlines())) > 250:
            long.append(f"{path} has {lines} lines, the limit is 250")
        for function in _functions(text):
            limit = 60 if function.is_kernel else 40
            if function.lines > limit:
                long.append(f"{path}: {function.name} has {function.lines} lines, the limit is {limit}")
    assert long == []


def test_a_folder_is_short_enough_to_read_at_once() -> None:
    entries: dict[str, set[str]] = {}
    for path in (Path(name) for name, _ in _tracked_texts() if not name.endswith(MARKERS)):
        for folder in path.parents[:-1]:
            entries.setdefault(folder.as_posix(), set()).add(path.relative_to(folder).parts[0])
    long = [f"{folder} has {len(names)} entries" for folder, names in entries.items() if len(names) > MAX_ENTRIES]
    assert [line for line in long if line.partition(" ")[0] not in COLLECTIONS] == []


def test_kernels_copy_no_array_into_another_by_an_assignment() -> None:
    """It contains a message about their shapes, which takes two seconds to compile; a loop has none."""
    copies = [
        f"{path}: {function.name} has {copy}"
        for path, text in _tracked_texts()
        if path.endswith(".py") and path.startswith(PACKAGES)
        for function in _functions(text)
        for copy in function.copies
    ]
    assert copies == []


def test_what_the_packages_import_is_required_by_name() -> None:
    wanted = [*PROJECT["project"]["dependencies"], *OPTIONAL]
    declared = {_normal(Requirement(line).name) for line in wanted}
    distributions = dict(packages_distributions()) | {"pydantic_core": ["pydantic"]}  # pydantic's own, documented by it
    distributions.pop("pyorbbecsdk", None)  # no extra can have it: its requirements contradict ours
    undeclared = {
        f"{path.relative_to(ROOT)}: {module}"
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        for module in _imported(path) - sys.stdlib_module_names - {*PACKAGES, "absmsg"}
        if module in distributions and not declared & set(map(_normal, distributions[module]))
    }
    assert undeclared == set()


def test_the_evaluation_imports_no_tests_but_in_its_benchmarks() -> None:
    """Tests judge by its scenes; the benchmarks are tests."""
    folder = ROOT / "evaluation"
    modules = [path for path in folder.rglob("*.py") if folder / "benchmarks" not in path.parents]
    assert modules
    assert [path for path in modules if "tests" in _imported(path)] == []


@functools.cache
def _tracked_texts() -> list[tuple[str, str]]:
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listing.returncode != 0:
        pytest.skip("not a git checkout")
    paths = [name for name in listing.stdout.split("\0") if name and (ROOT / name).is_file()]
    contents = [(name, (ROOT / name).read_bytes()) for name in paths]
    return [(name, data.decode("utf-8", errors="replace")) for name, data in contents if b"\0" not in data[:4096]]


class _Function(NamedTuple):
    name: str
    lines: int
    is_kernel: bool
    copies: tuple[str, ...]  # assignments of a kernel that copy an array into another


@functools.cache
def _functions(text: str) -> list[_Function]:
    """All functions of a module; to parse all modules takes seconds, and so does freeing their trees at exit."""
    return [_measured(node) for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]


def _measured(function: ast.FunctionDef) -> _Function:
    is_kernel = "kernel" in map(ast.unparse, function.decorator_list)
    assignments = [node for node in ast.walk(function) if isinstance(node, ast.Assign | ast.AugAssign)]
    copies = tuple(ast.unparse(node) for node in assignments if is_kernel and _copies(node))
    return _Function(function.name, _lines_of_code(function), is_kernel, copies)


def _not_portable(line: str) -> list[str]:
    paths = [match[0] for match in ABSOLUTE_PATH.finditer(line) if not STANDARD.match(match[0])]
    complaints = [f"{path} exists on this machine only" for path in paths if Path(path).exists()]
    complaints += [f"{match[0]} is somebody's home" for match in [HOME.search(line)] if match]
    complaints += [f"{match[0]} belongs into your own pip settings" for match in [PACKAGE_INDEX.search(line)] if match]
    return complaints


def _pins(name: str) -> dict[str, Version]:
    text = (ROOT / name).read_text(encoding="utf-8")
    return {pin: Version(version) for pin, version in re.findall(r"^([\w-]+)==([^\s;]+)", text, re.M)}


def _requirements(package: str) -> set[str]:
    """Requirements of the installed `package`; empty if it is not installed."""
    try:
        wanted = map(Requirement, requires(package) or [])
    except PackageNotFoundError:
        return set()
    return {_normal(line.name) for line in wanted if line.marker is None or line.marker.evaluate({"extra": ""})}


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _imported(path: Path) -> set[str]:
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    plain = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    return {name.split(".")[0] for name in [*plain, *(n.module or "" for n in nodes if isinstance(n, ast.ImportFrom))]}


def _copies(assignment: ast.Assign | ast.AugAssign) -> bool:
    """True if something else than a constant goes into a slice."""
    targets = assignment.targets if isinstance(assignment, ast.Assign) else [assignment.target]
    sliced = any(isinstance(node, ast.Slice) for target in targets for node in ast.walk(target))
    return sliced and any(isinstance(node, ast.Name) for node in ast.walk(assignment.value))


def _lines_of_code(function: ast.FunctionDef) -> int:
    first = function.body[1] if ast.get_docstring(function) and len(function.body) > 1 else function.body[0]
    return (function.body[0].lineno - function.lineno) + ((function.end_lineno or 0) - first.lineno + 1)


def test_make_says_what_takes_minutes_and_what_comes_next() -> None:
    alone = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}  # not by another make
    make = ["make", "-B", "-n", "all"]
    lines = subprocess.run(make, cwd=ROOT, env=alone, capture_output=True, text=True, check=True).stdout
    assert lines.count("minutes the first time") == 2
    assert "make run ARGS=--view" in lines.splitlines()[-1]
