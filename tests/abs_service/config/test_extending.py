"""The examples of docs/how-to/extending.md, installed beside the package, in a rig that tracks the sample recording."""

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

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "how-to" / "extending.md").read_text(encoding="utf-8")
PARTS = dict(re.findall(r"```python\n# my_parts/(\w+)\.py\n(.*?)```", PAGE, re.DOTALL))
PYPROJECT = PAGE.partition("```toml\n# pyproject.toml\n")[2].partition("```")[0]
SERVICE = ("-m", "abs_service")
SAMPLE = ROOT / "recordings" / "sample.mcap"

#: A thermal camera beside a depth camera; the second tracker does without.
THERMAL = """
version = 1
name = "plate"
devices.cameras.uri = "simulated://sheet?sensors=tof,ir"
synchronisation.reference = "tof/depth"

[sensors.tof]
device = "cameras"
noise = { type = "constant", sigma = 0.002 }

[sensors.thermal]
device = "cameras"
head = "ir"
noise = { type = "thermal", sigma_k = 0.1 }

[trackers.warm]
sensors = ["tof", "thermal"]
model = { type = "translation" }
mesh = { vertices = 300 }

[trackers.cold]
sensors = ["tof"]
model = { type = "translation" }
mesh = { vertices = 300 }

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

#: Tracks a disc before a wall with the page's template; prints status, centre [m] and largest radius [m].
DISC = """
import json
import numpy as np
import abs_service as a

camera = a.Camera(160, 120, fx=200, fy=200, cx=79.5, cy=59.5)
u, v = np.meshgrid(np.arange(160), np.arange(120))
x, y = (u - 79.5) / 200 * 0.6, (v - 59.5) / 200 * 0.6
on = np.hypot(x - 0.02, y + 0.01) < 0.1
depth = np.where(on, 0.6, 1.2) + np.random.default_rng(1).normal(0, 0.001, on.shape)
template = {"type": "disc", "radius": 0.1}
tracker = a.Tracker(camera, {"type": "translation"}, noise=a.noise.Constant(0.001), template=template, vertices=200)
found = tracker.track(depth, time_s=0)
center = found.vertices.mean(axis=0)
print(json.dumps([found.status, center.tolist(), float(np.linalg.norm(found.vertices - center, axis=1).max())]))
"""

#: Opens the page's device and reads from it for a while; prints frames, drops, the depth in the middle [m] and states.
READING = """
import json, time
from drivers import opening

class Reader:
    frames, states = [], []
    def on_frame(self, frame): self.frames.append(frame)
    def on_state(self, state, reason): self.states.append(state)
    def on_truth(self, truth): ...
    def on_warning(self, condition, message): ...

device, reader = opening.open_device("plate://", time.monotonic_ns), Reader()
device.start(reader)
deadline = time.monotonic() + 20
while len(reader.frames) < 10 and time.monotonic() < deadline:
    time.sleep(0.01)
device.close()
count = len(reader.frames)
time.sleep(0.1)
depth = float(reader.frames[-1].si()[36, 48])
late = len(reader.frames) - count
print(json.dumps([dict(device.counters), count, late, [f.seq for f in reader.frames[:10]], depth, reader.states]))
"""

#: A kind of measurement whose noise model is derived from one of ours, and a program that asks for the kinds of both.
DERIVED = """
from abs_service.tracker.measurements import grey

class Noise(grey.Noise): ...
class Measurement(grey.Measurement): ...
"""
ASKING = """
import json
from my_parts import derived
from abs_service.tracker.measurements import grey, measurement

print(json.dumps([type(measurement(noise)).__module__ for noise in (grey.Noise(), derived.Noise())]))
"""


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


def printed(environment: dict[str, str], program: str, *arguments: Path) -> list[Any]:
    """The output of a program, read as JSON."""
    return json.loads(run(environment, "-c", program, *arguments).stdout)


def test_the_page_has_an_example_for_each_entry_point() -> None:
    parts = ["translation", "random_search", "left_half", "disc", "depth_only", "linear", "thermal", "plate"]
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
