"""The TOML tables in the docs load, and name every key of every exchangeable part with its default."""

import re
import tomllib
from collections import defaultdict
from dataclasses import MISSING, fields
from pathlib import Path

import pytest

from abs_service.config import plugins

ROOT = Path(__file__).parents[3]
PACKAGES = {
    "region": "abs_service.tracker.detection.regions",
    "template": "abs_service.tracker.detection.templates",
    "model": "abs_service.tracker.models",
    "optimizer": "abs_service.tracker.optimizers",
}
PATHS = {part: next((ROOT / "docs").glob(f"*/{part}s.md")) for part in PACKAGES}
PAGES = {part: path.read_text(encoding="utf-8") for part, path in PATHS.items()}
TABLES = defaultdict(list)
for part, page in PAGES.items():
    for block in re.findall(r"```toml\n(.*?)```", page, re.DOTALL):
        for tracker in tomllib.loads(block)["trackers"].values():
            TABLES[part, tracker[part]["type"]].append(tracker[part])
#: Keys that the pages set to something else than their default, to show what they do.
SHOWN = {("region", "grow")}


def documented(part):
    return sorted(name for of, name in TABLES if of == part)


@pytest.mark.parametrize("part", PACKAGES)
def test_every_part_has_a_table_and_is_in_the_list_of_all(part):
    assert documented(part) == plugins.available(PACKAGES[part])
    lines = (ROOT / "docs" / "how-to" / "my-object.md").read_text(encoding="utf-8").splitlines()
    row = next(line for line in lines if line.startswith(f"| `{part}`"))
    assert all(f"`{name}`" in row for name in documented(part))


@pytest.mark.parametrize(("part", "name"), TABLES)
def test_the_tables_of_a_part_name_all_keys_with_their_defaults(part, name):
    tables = TABLES[part, name]
    made = [plugins.load(PACKAGES[part], table, ROOT) for table in tables]
    assert set().union(*tables) == {"type", *(field.name for field in fields(made[0]))}
    for one, table in zip(made, tables):
        for field in fields(one):
            if field.name in table and field.default not in (MISSING, None) and (part, field.name) not in SHOWN:
                assert getattr(one, field.name) == field.default, field.name


@pytest.mark.parametrize(
    ("part", "name", "key"), [("template", "mesh", "path"), ("region", "mask", "file"), ("region", "seed", "within")]
)
def test_a_path_starts_from_the_folder_of_the_rig_file(part, name, key):
    table = next(table for table in TABLES[part, name] if key in table)
    assert getattr(plugins.load(PACKAGES[part], table, ROOT), key) == ROOT / table[key]


@pytest.mark.parametrize("part", ["region", "optimizer"])
def test_every_part_has_a_row(part):
    rows = re.findall(r"^\| `(\w+)` \|", PAGES[part], re.MULTILINE)
    assert set(documented(part)) <= set(rows)
