"""The TOML tables in the docs load, and name every key of every template, model and optimizer with its default."""

import re
import tomllib
from dataclasses import MISSING, fields
from pathlib import Path

import pytest

from abs_service.config import plugins
from abs_service.config.tables import TrackerTable
from abs_service.tracker.optimizers.base import Stop

ROOT = Path(__file__).parents[3]
PACKAGES = {
    "template": "abs_service.tracker.detection.templates",
    "model": "abs_service.tracker.models",
    "optimizer": "abs_service.tracker.optimizers",
}
PAGES = {part: (ROOT / "docs" / f"{part}s.md").read_text(encoding="utf-8") for part in PACKAGES}
TABLES = {
    (part, tracker[part]["type"]): tracker[part]
    for part, page in PAGES.items()
    for block in re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    for tracker in tomllib.loads(block)["trackers"].values()
}


def documented(part):
    return sorted(name for of, name in TABLES if of == part)


@pytest.mark.parametrize("part", PACKAGES)
def test_every_part_has_a_table(part):
    assert documented(part) == plugins.available(PACKAGES[part])


@pytest.mark.parametrize(("part", "name"), TABLES)
def test_a_table_names_all_keys_with_their_defaults(part, name):
    made, table = plugins.load(PACKAGES[part], TABLES[part, name], ROOT), TABLES[part, name]
    assert table.keys() == {"type", *(field.name for field in fields(made))}
    for field in fields(made):
        if field.default is not MISSING:
            assert getattr(made, field.name) == field.default, field.name


def test_every_template_is_in_the_readme():
    readme = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    row = next(line for line in readme if "docs/templates.md" in line)
    assert all(f"`{name}`" in row for name in documented("template"))


def test_the_path_of_a_template_starts_from_the_folder_of_the_rig_file():
    assert plugins.load(PACKAGES["template"], TABLES["template", "mesh"], ROOT).path == ROOT / "toy.obj"


def test_every_optimizer_has_a_row():
    rows = re.findall(r"^\| `(\w+)` \|", PAGES["optimizer"].partition("## Keys")[0], re.MULTILINE)
    assert set(rows) == {"type", *documented("optimizer")}


@pytest.mark.parametrize("key", ["budget_evaluations", "budget_ms"])
def test_the_budget_is_as_the_page_says(key):
    assert f"| `{key}` | {round(TrackerTable.model_fields[key].default)} |" in PAGES["optimizer"]


def test_every_reason_to_stop_is_named():
    for stop in set(Stop) - {Stop.NOTHING}:
        assert f"`{stop.name}`" in PAGES["optimizer"]
