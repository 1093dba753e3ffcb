"""What docs/templates.md shows works: it has a table for every template, with all of its keys and defaults."""

import re
import tomllib
from dataclasses import MISSING, fields
from pathlib import Path

import pytest

from abs_service.config import plugins

PACKAGE = "abs_service.tracker.detection.templates"
ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "templates.md").read_text(encoding="utf-8")
TABLES = {
    tracker["template"]["type"]: tracker["template"]
    for block in re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    for tracker in tomllib.loads(block)["trackers"].values()
}


def test_every_template_has_a_table_and_is_in_the_readme():
    assert sorted(TABLES) == plugins.available(PACKAGE)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    row = next(line for line in readme.splitlines() if "docs/templates.md" in line)
    assert all(f"`{name}`" in row for name in TABLES)


@pytest.mark.parametrize("name", TABLES)
def test_a_table_names_all_keys_of_its_template_with_their_defaults(name):
    made = plugins.load(PACKAGE, TABLES[name], ROOT)
    assert TABLES[name].keys() - {"type"} == {field.name for field in fields(made)}
    for field in fields(made):
        if field.default is not MISSING:
            assert getattr(made, field.name) == field.default


def test_paths_start_from_the_folder_of_the_rig_file():
    assert plugins.load(PACKAGE, TABLES["mesh"], ROOT).path == ROOT / "toy.obj"
