"""Parts that docs/how-to/extending installs are declared, and those that cannot be used are named."""

import os
import re

import pytest

from abs_service import config
from tests.abs_service.config.extending_programs import ASKING, DERIVED
from tests.abs_service.config.test_extending import (
    PAGES,
    PARTS,
    PYPROJECT,
    SERVICE,
    install,
    printed,
    rig_file,
    run,
)


def test_what_the_page_installs_declares_its_parts(tmp_path) -> None:
    """With the page's own command, but without its dependencies, which are here."""
    (command,) = re.findall(r"^\.venv/bin/(pip install -e \S+) +#", PAGES["index.md"], re.MULTILINE)
    project, site = tmp_path / "my-parts", tmp_path / "site"
    (project / "my_parts").mkdir(parents=True)
    (project / "pyproject.toml").write_text(PYPROJECT, encoding="utf-8")
    for name, text in {"__init__": "", **PARTS}.items():
        (project / "my_parts" / f"{name}.py").write_text(text, encoding="utf-8")
    options = ("--target", site, "--no-deps", "--no-build-isolation", "--no-index", "--quiet")
    run(dict(os.environ), "-m", *command.replace("-e path/to/my-parts", str(project)).split(), *options)
    (declared,) = site.glob("my_parts-*.dist-info/entry_points.txt")
    assert declared.read_text().count(" = my_parts.") == len(PARTS)


def test_a_declared_measurement_may_have_a_derived_noise_and_a_broken_one_disturbs_nobody(tmp_path) -> None:
    group, names = "abs_service.tracker.measurements", ("broken", "derived")
    parts = {"broken": "raise ImportError", "derived": DERIVED}
    environment = install(tmp_path / "site", parts, [(group, name, f"my_parts.{name}") for name in names])
    assert printed(environment, ASKING) == ["abs_service.tracker.measurements.grey", "my_parts.derived"]


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({}, "cannot be imported: ModuleNotFoundError: No module named 'my_parts.left_half'"),
        ({"left_half": "1 / 0"}, "cannot be imported: ZeroDivisionError: division by zero"),
        ({"left_half": ""}, "has no Settings"),
    ],
)
def test_a_declared_part_that_cannot_be_used_is_named(tmp_path, parts, message) -> None:
    declared = [("abs_service.tracker.detection.regions", "left_half", "my_parts.left_half")]
    environment = install(tmp_path / "site", parts, declared)
    rig = tmp_path / "rig.toml"
    rig.write_text(config.to_toml(config.load_default()).replace('type = "nearest"', 'type = "left_half"'))
    refused = run(environment, *SERVICE, "check", rig, status=2)
    assert "Traceback" not in refused.stderr
    named = (
        f'trackers.sheet.region.type = "left_half": entry point left_half = my_parts.left_half of my-parts {message}'
    )
    assert named in refused.stderr


def test_parts_that_are_not_installed_are_refused_with_what_there_is(tmp_path) -> None:
    refused = run(dict(os.environ), *SERVICE, "check", rig_file(tmp_path), status=2)
    assert 'type = "translation": no such type' in refused.stderr
    assert "nurbs" in refused.stderr
