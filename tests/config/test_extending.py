"""The examples of docs/extending.md, installed beside the package, in a rig file that tracks the sample recording."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from abs_service import config

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
PARTS = dict(re.findall(r"```python\n# my_parts/(\w+)\.py\n(.*?)```", PAGE, re.DOTALL))
SAMPLE = ROOT / "recordings" / "sample.mcap"


@pytest.fixture
def installed(tmp_path: Path) -> dict[str, str]:
    """An environment in which the examples are a distribution with the page's entry points."""
    package = tmp_path / "site" / "my_parts"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    for name, text in PARTS.items():
        (package / f"{name}.py").write_text(text, encoding="utf-8")
    information = tmp_path / "site" / "my_parts-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: my-parts\nVersion: 1.0\n")
    declared = re.findall(r'\[project\.entry-points\."([\w.]+)"\]\n(\w+) = "([\w.]+)"', PAGE)
    points = [f"[{group}]\n{name} = {module}\n" for group, name, module in declared]
    (information / "entry_points.txt").write_text("\n".join(points))
    path = os.pathsep.join([str(tmp_path / "site"), *sys.path])
    return {**os.environ, "PYTHONPATH": path}


def rig_file(folder: Path) -> Path:
    """The demo rig with every part from the page."""
    text = config.to_toml(config.load_default())
    text = re.sub(r"(?s)(\[trackers\.sheet\.model\]\n).*?\n(?=\[)", r'\1type = "translation"\n\n', text)
    text = re.sub(r"(?s)(\[trackers\.sheet\.optimizer\]\n).*?(\n\[|\Z)", r'\1type = "random_search"\n\2', text)
    text = re.sub(r"(?s)(\[trackers\.sheet\.region\]\n).*?\n(?=\[)", r'\1type = "left_half"\n\n', text)
    noise = r'\1type = "linear"\nper_metre = 0.004\n\n'
    text = re.sub(r"(?s)(\[sensors\.tof\.noise\]\n).*?\n(?=\[)", noise, text)
    path = folder / "rig.toml"
    path.write_text(text, encoding="utf-8")
    return path


def run(environment: dict[str, str], *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "abs_service", *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240, check=False)


def test_the_page_has_an_example_for_each_entry_point() -> None:
    assert set(PARTS) == {"translation", "random_search", "left_half", "linear"}


def test_parts_of_another_distribution_track_a_recording(installed, tmp_path) -> None:
    rig = rig_file(tmp_path)
    checked = run(installed, "check", rig)
    assert checked.returncode == 0, checked.stderr
    done = run(installed, "replay", SAMPLE, "--config", rig, "--json", "--out", tmp_path / "out.mcap")
    assert done.returncode == 0, done.stderr
    estimates = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(estimates) == 15
    assert {len(estimate["theta"]) for estimate in estimates} == {3}
    assert {estimate["status"] for estimate in estimates} <= {"TRACKING", "DEGRADED", "LOST"}


def test_parts_that_are_not_installed_are_refused_with_what_there_is(tmp_path) -> None:
    refused = run(dict(os.environ), "check", rig_file(tmp_path))
    assert refused.returncode == 2
    assert 'type = "translation": no such type' in refused.stderr
    assert "nurbs" in refused.stderr
