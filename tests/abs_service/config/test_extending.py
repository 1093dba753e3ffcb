"""The examples of docs/how-to/extending, installed beside the package, in a rig that tracks the sample recording."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomli_w

import abs_service as a
from abs_service import config
from tests.abs_service.config.extending_programs import DISC, MARGIN, READING, SLIDING, THERMAL

ROOT = Path(__file__).parents[3]
PAGES = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "docs/how-to/extending").glob("*.md")}
PARTS = dict(re.findall(r"```python\n# my_parts/(\w+)\.py\n(.*?)```", "".join(PAGES.values()), re.DOTALL))
PYPROJECT = PAGES["index.md"].partition("```toml\n# pyproject.toml\n")[2].partition("```")[0]
SERVICE = ("-m", "abs_service")
SAMPLE = ROOT / "recordings" / "sample.mcap"


@pytest.fixture
def installed(tmp_path: Path) -> dict[str, str]:
    """An environment in which the examples are a distribution with the page's entry points."""
    groups = tomllib.loads(PYPROJECT)["project"]["entry-points"].items()
    declared = [(group, name, module) for group, points in groups for name, module in points.items()]
    return install(tmp_path / "site", PARTS, declared)


def install(site: Path, parts: dict[str, str], declared: list[tuple[str, str, str]]) -> dict[str, str]:
    """An environment with a distribution of these modules, which declares (group, name, module)."""
    package, information = site / "my_parts", site / "my_parts-1.0.dist-info"
    package.mkdir(parents=True)
    information.mkdir()
    for name, text in {"__init__": "", **parts}.items():
        (package / f"{name}.py").write_text(text, encoding="utf-8")
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: my-parts\nVersion: 1.0\n")
    points = [f"[{group}]\n{name} = {module}\n" for group, name, module in declared]
    (information / "entry_points.txt").write_text("\n".join(points))
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), *sys.path])}


def rig_file(folder: Path) -> Path:
    """The demo rig with every part from the page."""
    tree = tomllib.loads(config.to_toml(config.load_default()))
    parts = {"model": "translation", "optimizer": "random_search", "region": "left_half", "objective": "depth_only"}
    tree["trackers"]["sheet"] |= {table: {"type": part} for table, part in parts.items()}
    tree["sensors"]["tof"]["noise"] = {"type": "linear", "per_metre": 0.004}
    path = folder / "rig.toml"
    path.write_text(tomli_w.dumps(tree), encoding="utf-8")
    return path


def run(environment: dict[str, str], *arguments: str | Path, status: int = 0) -> subprocess.CompletedProcess[str]:
    """Runs Python with these arguments, which has to end with this status."""
    command = [sys.executable, *map(str, arguments)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240, check=False)
    assert done.returncode == status, done.stderr
    return done


def printed(environment: dict[str, str], program: str, *arguments: Path) -> Any:
    """The output of a program, read as JSON."""
    return json.loads(run(environment, "-c", program, *arguments).stdout)


def test_the_page_has_an_example_for_each_entry_point() -> None:
    parts = ["translation", "random_search", "left_half", "disc", "depth_only", "inner", "linear", "thermal", "plate"]
    assert sorted(PARTS) == sorted(parts)


def test_parts_of_another_distribution_track_a_recording(installed, tmp_path) -> None:
    rig = rig_file(tmp_path)
    run(installed, *SERVICE, "check", rig)
    done = run(installed, *SERVICE, "replay", SAMPLE, "--config", rig, "--json", "--out", tmp_path / "out.mcap")
    estimates = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(estimates) == 15
    assert {len(estimate["theta"]) for estimate in estimates} == {3}
    fits = a.open_recording(tmp_path / "out.mcap").estimates()
    assert {sensor for estimate in fits for sensor in estimate.residuals} == {"tof"}  # the objective of the page
    assert {estimate["status"] for estimate in estimates} <= {"TRACKING", "DEGRADED", "LOST"}


def test_a_measurement_of_another_distribution_counts(installed, tmp_path) -> None:
    rig = tmp_path / "plate.toml"
    rig.write_text(THERMAL, encoding="utf-8")
    checked = run(installed, *SERVICE, "check", rig)
    assert "noise thermal" in checked.stdout
    off, residuals = printed(installed, SLIDING, rig)
    assert off["warm"] < 5e-4
    assert off["cold"] > 5e-3  # distances alone do not show that a wall slides along itself
    # A wave of 3 K is read from the nearest pixels, which adds to its noise by where in them the vertices lie.
    assert residuals["thermal"] == pytest.approx(1, abs=0.5)


def test_a_synthesis_of_another_distribution_masks_the_margin(installed) -> None:
    error = printed(installed, MARGIN)
    assert error["inner"] < 5e-4
    assert error["sparse"] > 1e-3


def test_a_template_of_another_distribution_finds_its_object(installed) -> None:
    status, center, radius = printed(installed, DISC)
    assert status == "TRACKING"
    assert center == pytest.approx([0.02, -0.01, 0.6], abs=0.003)
    assert radius == pytest.approx(0.1, abs=0.003)


def test_a_device_of_another_distribution_delivers(installed) -> None:
    counters, count, late, numbers, depth, states = printed(installed, READING)
    assert counters == {"frames": count}
    assert count >= 10
    assert late == 0  # nothing comes after the device is closed
    assert numbers == list(range(10))
    # It swings by 20 mm, and 0.62 in single precision is a little more.
    assert depth == pytest.approx(0.6, abs=0.020001)
    assert states == ["opening", "streaming", "closed"]


def test_a_device_of_another_distribution_is_listed_and_its_addresses_checked(installed, tmp_path) -> None:
    listed = run(installed, *SERVICE, "devices", "--json")
    assert "plate://1" in listed.stdout
    rig = tmp_path / "plate.toml"
    text = THERMAL.partition("[sensors.thermal]")[0].replace("simulated://sheet?sensors=tof,ir", "plate://2")
    rig.write_text(text, encoding="utf-8")
    refused = run(installed, *SERVICE, "check", rig, status=2)
    assert "must be plate:// or plate://1" in refused.stderr
