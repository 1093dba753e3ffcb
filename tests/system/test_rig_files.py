"""Every rig file in examples/rigs does what its first lines say, with the commands themselves."""

import json
import signal
import threading
from pathlib import Path

import cv2
import numpy as np
import pytest

from abs_service import config
from drivers.replay import Recording
from drivers.simulated.address import parse
from tests.abs_service.commands.recordings.simulated_recording import write_take
from tests.system.running import START_S, abs_service, wait_until

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[2] / "examples" / "rigs"
#: Those that need recordings or images which are not in the repository.
WITH_FILES = {"replay", "image_folder"}
WITHOUT_TRACKER = {"record_only"}
#: Those that need cameras; `test_kinects.py` has a rig of emulated ones.
WITH_CAMERAS = {"azure", "genicam", "kinect", "o3r", "oak_stereo", "oak_tof", "orbbec", "realsense"}
LIVE = sorted(
    path.stem for path in EXAMPLES.glob("*.toml") if path.stem not in WITH_FILES | WITHOUT_TRACKER | WITH_CAMERAS
)


@pytest.fixture
def example(tmp_path, endpoint):
    """Copies an example to a folder of its own, with an endpoint of its own."""

    def copied(name):
        path = tmp_path / "examples" / "rigs" / f"{name}.toml"
        path.parent.mkdir(parents=True)
        text = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
        path.write_text(f'{text}\n[bus]\nendpoint = "{endpoint}"\n', encoding="utf-8")
        return path

    return copied


@pytest.fixture
def tracks(launch):
    """Runs a rig until each of its trackers has tracked thirty times; everything that it printed."""

    def run(path):
        wanted = set(config.load(path).trackers)
        process = launch("run", path, "--json", "--no-record", stdout=-1)
        watchdog = threading.Timer(START_S, process.kill)
        watchdog.start()
        estimates = []
        for line in process.stdout:
            estimates.append(json.loads(line))
            tracked = [one["tracker"] for one in estimates if one["status"] == "TRACKING"]
            if all(tracked.count(name) >= 30 for name in wanted):
                break
        process.send_signal(signal.SIGTERM)
        complaints = process.communicate(timeout=10)[1]
        watchdog.cancel()
        assert process.returncode == 0, complaints
        assert {one["tracker"] for one in estimates if one["status"] == "TRACKING"} == wanted
        return estimates

    return run


def recorded(path, exposures=range(60)):
    """A take with a depth and a colour camera, called as the examples call them."""
    simulation = parse("simulated://sheet?seed=1&sensors=structured_light,color").build()
    path.parent.mkdir(exist_ok=True)
    return simulation, write_take(path, simulation, exposures, {"structured_light": "depth", "color": "color"})


@pytest.mark.realtime
@pytest.mark.parametrize("name", LIVE)
def test_it_tracks(name, example, tracks):
    errors: dict[str, list[float]] = {}
    for estimate in tracks(example(name)):
        if estimate["status"] == "TRACKING" and estimate["error_mm"] is not None:
            errors.setdefault(estimate["tracker"], []).append(estimate["error_mm"])
    for tracker, some in errors.items():
        print(f"{name}, {tracker}: median error {np.median(some):.2f} mm in {len(some)} estimates")
        assert min(some) < 4  # how far it lags behind while it moves is a matter of how busy the machine is


@pytest.mark.realtime
def test_it_plays_a_recording_as_if_it_were_live(example, tracks, tmp_path):
    recorded(tmp_path / "recordings" / "scene.mcap")
    assert len(tracks(example("replay"))) >= 30


def test_it_tracks_images_that_were_imported(example, tmp_path):
    rig_file = example("image_folder")
    simulation, take = recorded(tmp_path / "toy.mcap")
    distance = simulation.frames(0)[0].si()
    cv2.imwrite(str(rig_file.with_name("mask.png")), np.where(distance < 1.2, 255, 0).astype(np.uint8))
    done = abs_service("replay", take, "--config", rig_file, "--json")
    assert done.returncode == 0, done.stderr
    estimates = [json.loads(line) for line in done.stdout.splitlines()]
    assert [one["status"] for one in estimates] == ["TRACKING"] * 60
    assert max(one["error_mm"] for one in estimates) < 4


@pytest.mark.realtime
def test_it_records_without_tracking(example, launch, tmp_path):
    folder = tmp_path / "takes"
    process = launch("run", example("record_only"), "--out", folder)
    wait_until(lambda: sum(path.stat().st_size for path in folder.glob("*")) > 1e7, START_S, "a growing file")
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) == 0
    (path,) = folder.glob("*.mcap")
    counts = Recording(path).counts
    assert min(counts["tof", "depth"], counts["color", "color"]) > 10
