import importlib.metadata
import sys
from pathlib import Path

import pytest

from abs_service.config import plugins
from abs_service.config.problems import ProblemsError
from drivers import opening

BENDY = """
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated
from annotated_types import Interval

@dataclass(frozen=True)
class Bendy:
    degree: Annotated[int, Interval(ge=1, le=4)] = 2
    control_points: tuple[int, int] = (4, 4)
    mask: Path | None = None

    def __post_init__(self) -> None:
        if self.degree >= min(self.control_points):
            raise ValueError("degree must be below the number of control points")

Settings = Bendy
"""

AROUND = """
from dataclasses import dataclass, field
from typing import Any

@dataclass(frozen=True)
class Settings:
    inner: Any = field(metadata={"parts": "parts_for_test"})
    size: int = 1
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of parts on disk: one with settings, one that takes another one, one without."""
    folder = tmp_path / "parts_for_test"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "bendy.py").write_text(BENDY)
    (folder / "around.py").write_text(AROUND)
    (folder / "base.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield "parts_for_test"
    for name in [name for name in sys.modules if name.startswith("parts_for_test")]:
        del sys.modules[name]


def problems(package, table):
    with pytest.raises(ProblemsError) as caught:
        plugins.load(package, table, Path())
    return [str(problem) for problem in caught.value.problems]


def test_the_type_names_the_module_and_the_other_keys_are_its_settings(package):
    made = plugins.load(package, {"type": "bendy", "degree": 3, "control_points": [5, 6]}, Path())
    assert (made.degree, made.control_points) == (3, (5, 6))


def test_only_modules_with_settings_are_available(package):
    assert plugins.available(package) == ["around", "bendy"]


def test_parts_that_are_not_configured_are_not_imported(package, tmp_path):
    (tmp_path / package / "heavy.py").write_text("raise ImportError('this takes long')")
    plugins.load(package, {"type": "bendy"}, Path())
    assert f"{package}.heavy" not in sys.modules


def test_installed_distributions_are_read_once(package, monkeypatch):
    looks, entry_points = [], importlib.metadata.entry_points
    monkeypatch.setattr(
        importlib.metadata, "entry_points", lambda **chosen: looks.append(chosen) or entry_points(**chosen)
    )
    opening.declared.cache_clear()
    for _ in range(3):
        plugins.load(package, {"type": "bendy"}, Path())
    assert len(looks) <= 1


def test_relative_paths_start_from_the_given_folder(package):
    table = {"type": "bendy", "mask": "masks/a.png"}
    assert plugins.load(package, table, Path("/rig")).mask == Path("/rig/masks/a.png")
    assert plugins.load(package, table | {"mask": "/a.png"}, Path("/rig")).mask == Path("/a.png")


def test_a_table_made_from_settings_loads_again(package):
    made = plugins.load(package, {"type": "bendy", "mask": "a.png"}, Path("/rig"))
    assert plugins.load(package, plugins.table(made), Path("/elsewhere")) == made


def test_an_unknown_type_is_answered_with_what_there_is(package):
    assert problems(package, {"type": "bendi"}) == [
        'type = "bendi": no such type, did you mean "bendy"? allowed: around, bendy'
    ]


@pytest.mark.parametrize("name", ["base", "../bendy", "os.path", ""])
def test_a_type_reaches_nothing_but_the_modules_of_its_package(package, name):
    assert "no such type" in problems(package, {"type": name})[0]


def test_all_problems_of_a_table_are_reported_at_once(package):
    found = problems(package, {"type": "bendy", "degreee": 2, "degree": 9, "control_points": [4, "4"]})
    assert found == [
        'degreee: unknown key, did you mean "degree"? allowed: control_points, degree, mask',
        "degree = 9: must be less than or equal to 4",
        'control_points[1] = "4": must be a valid integer',
    ]


def test_errors_of_the_settings_class_are_reported_verbatim(package):
    assert "degree must be below" in problems(package, {"type": "bendy", "degree": 4})[0]


@pytest.mark.parametrize(
    ("table", "example"),
    [("bendy", "bendy"), ("bend", "around"), (3, "around"), ({}, "around"), ({"type": 1}, "around")],
)
def test_what_is_no_table_with_a_type_is_answered_with_an_example(package, table, example):
    assert f'must be a table such as {{ type = "{example}"' in problems(package, table)[0]


def test_a_misspelt_type_is_named(package):
    assert problems(package, {"tpye": "bendy"}) == ['tpye: unknown key, did you mean "type"? types: around, bendy']


def test_a_part_may_hold_another_part(package):
    inner = {"type": "bendy", "degree": 3, "mask": "a.png"}
    made = plugins.load(package, {"type": "around", "inner": inner}, Path("/rig"))
    assert (made.size, made.inner.degree, made.inner.mask) == (1, 3, Path("/rig/a.png"))
    assert plugins.table(made)["inner"]["type"] == "bendy"
    assert plugins.load(package, plugins.table(made), Path("/elsewhere")) == made


def test_problems_in_both_parts_are_reported_with_their_full_keys(package):
    inner = {"type": "bendy", "degreee": 2, "degree": 9}
    assert problems(package, {"type": "around", "inner": inner, "size": "2", "sice": 2}) == [
        'sice: unknown key, did you mean "size"? allowed: inner, size',
        'inner.degreee: unknown key, did you mean "degree"? allowed: control_points, degree, mask',
        "inner.degree = 9: must be less than or equal to 4",
        'size = "2": must be a valid integer',
    ]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({}, "inner: missing, but needed"),
        ({"inner": "bendy"}, 'inner = "bendy": must be a table such as { type = "bendy"'),
        ({"inner": {"type": "bend"}}, 'inner.type = "bend": no such type, did you mean "bendy"?'),
    ],
)
def test_a_part_that_another_one_needs_must_be_one(package, table, message):
    (problem,) = problems(package, {"type": "around"} | table)
    assert message in problem
