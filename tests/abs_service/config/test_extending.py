"""The examples of docs/how-to/extending.md, installed beside the package, in a rig that tracks the sample recording."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from abs_service import config

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "how-to" / "extending.md").read_text(encoding="utf-8")
PARTS = dict(re.findall(r"```python\n# my_parts/(\w+)\.py\n(.*?)```", PAGE, re.DOTALL))
SAMPLE = ROOT / "recordings" / "sample.mcap"

#: A thermal camera beside a depth camera; the second tracker does without.
THERMAL = """
version = 1
name = "plate"

[devices.cameras]
uri = "simulated://sheet?sensors=tof,ir"

[sensors.tof]
device = "cameras"
noise = { type = "constant", sigma = 0.002 }

[sensors.thermal]
device = "cameras"
head = "ir"
noise = { type = "thermal", sigma_k = 0.1 }

[synchronisation]
reference = "tof/depth"

[trackers.warm]
sensors = ["tof", "thermal"]
model = { type = "translation" }

[trackers.cold]
sensors = ["tof"]
model = { type = "translation" }

[record]
"""

#: Tracks a patch of a wall that slides along itself by 2 mm a frame; prints the largest error of each tracker [m] and
#: the last residuals.
SLIDING = """
import json, sys
import numpy as np
import abs_service as a

camera = a.Camera(96, 72, fx=120, fy=120, cx=47.5, cy=35.5)
rig, generator = a.load_rig(sys.argv[1]), np.random.default_rng(1)
x, y = np.meshgrid((np.arange(96) - 47.5) / 120, (np.arange(72) - 35.5) / 120)
mask = (abs(x) < 0.15) & (abs(y) < 0.12)
trackers = {name: rig.tracker(name, cameras=dict.fromkeys(rig.sensors, camera)) for name in rig.trackers}
trackers["warm"].warm_up()
found, off = {}, dict.fromkeys(trackers, 0.0)
for k in range(6):
    depth = generator.normal(1, 0.002, x.shape)
    kelvin = 300 + 3 * np.sin((x - 0.002 * k) / 0.02) + 3 * np.sin(y / 0.02) + generator.normal(0, 0.1, x.shape)
    streams = {"warm": {"thermal/ir": kelvin}, "cold": None}
    common = {"depth_m": depth, "time_s": k / 30, "mask": mask}
    for name, tracker in trackers.items():
        found[name] = tracker.track(**common, streams=streams[name])
        off[name] = max(off[name], abs(found[name].theta[0] - 0.002 * k))
print(json.dumps([off, dict(found["warm"].residuals)]))
"""


#: A kind of measurement whose noise model is derived from one of ours, and a program that asks for the kinds of both.
DERIVED = """
from abs_service.tracker.measurements import grey

class Noise(grey.Noise): ...
class Measurement(grey.Measurement): ...
"""
ASKING = """
from my_parts import derived
from abs_service.tracker.measurements import grey, measurement

for noise in (grey.Noise(), derived.Noise()):
    print(type(measurement(noise)).__module__)
"""


@pytest.fixture
def installed(tmp_path: Path) -> dict[str, str]:
    """An environment in which the examples are a distribution with the page's entry points."""
    declared = re.findall(r'\[project\.entry-points\."([\w.]+)"\]\n(\w+) = "([\w.]+)"', PAGE)
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
    assert set(PARTS) == {"translation", "random_search", "left_half", "linear", "thermal"}


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


def test_a_measurement_of_another_distribution_counts(installed, tmp_path) -> None:
    rig = tmp_path / "plate.toml"
    rig.write_text(THERMAL, encoding="utf-8")
    checked = run(installed, "check", rig)
    assert checked.returncode == 0, checked.stderr
    assert "noise thermal" in checked.stdout
    command = [sys.executable, "-c", SLIDING, str(rig)]
    done = subprocess.run(command, env=installed, capture_output=True, text=True, timeout=240, check=False)
    assert done.returncode == 0, done.stderr
    off, residuals = json.loads(done.stdout)
    assert off["warm"] < 5e-4
    assert off["cold"] > 5e-3  # distances alone do not show that a wall slides along itself
    assert residuals["thermal"] == pytest.approx(1, abs=0.3)


def test_a_declared_measurement_may_have_a_derived_noise_and_a_broken_one_disturbs_nobody(tmp_path) -> None:
    group, names = "abs_service.tracker.measurements", ("broken", "derived")
    parts = {"broken": "raise ImportError", "derived": DERIVED}
    environment = install(tmp_path / "site", parts, [(group, name, f"my_parts.{name}") for name in names])
    command = [sys.executable, "-c", ASKING]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["abs_service.tracker.measurements.grey", "my_parts.derived"]


def test_parts_that_are_not_installed_are_refused_with_what_there_is(tmp_path) -> None:
    refused = run(dict(os.environ), "check", rig_file(tmp_path))
    assert refused.returncode == 2
    assert 'type = "translation": no such type' in refused.stderr
    assert "nurbs" in refused.stderr
