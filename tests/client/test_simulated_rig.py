"""Simulated rigs for tests of other programs: their settings, and how a start that fails is told."""

import shlex
import subprocess
import sys

import pytest
from abs_client import RigFailedError, SimulatedRig, run_rig, simulated_rig
from abs_client.pytest_plugin import settings_of

from abs_service import config
from drivers.simulated.address import parse


def test_the_file_is_a_valid_rig_with_all_settings(tmp_path):
    settings = SimulatedRig(seed=5, rate=60, speed=2, fault="stall@90", keys={"occluder": "hand"}, name="lab")
    rig = config.loads(settings.file("tcp/127.0.0.1:7000"), "rig", tmp_path)
    assert (rig.name, rig.bus.endpoint) == ("lab", "tcp/127.0.0.1:7000")
    assert rig.devices["sim"].uri == "simulated://sheet?seed=5&rate=60&speed=2&occluder=hand&fault=stall@90"
    assert rig.trackers["sheet"].budget_ms == 12.0


def test_a_faster_or_slower_rig_has_the_same_images_once_the_object_moves(tmp_path):
    def images(rate, speed):
        rig = config.loads(SimulatedRig(seed=3, rate=rate, speed=speed).file("tcp/127.0.0.1:7000"), "rig", tmp_path)
        frames = parse(rig.devices["sim"].uri).build().frames(240)  # in the fifth second, or later
        return [frame.data.tobytes() for frame in frames]

    assert images(60, 2) == images(30, 1) == images(15, 0.5)
    assert images(60, 1) != images(30, 1)


def test_keys_of_options_and_marks_are_settings_or_go_to_the_simulator():
    settings = settings_of({"seed": "5", "rate": 60, "noise": 2, "leave": "3,5"})
    assert settings == SimulatedRig(seed=5, rate=60.0, keys={"noise": "2", "leave": "3,5"})
    with pytest.raises(pytest.UsageError, match="numbers"):
        settings_of({"seed": "five"})


def test_a_service_that_refuses_the_settings_is_told_with_its_words():
    with pytest.raises(RigFailedError, match=r"exit code 2[\s\S]*devices.sim.uri"), run_rig(SimulatedRig(fault="rain")):
        pass


def test_a_rig_that_never_tracks_is_ended(monkeypatch):
    monkeypatch.setattr(simulated_rig, "START_S", 0.5)
    idle = SimulatedRig(service=shlex.join([sys.executable, "-c", "import time; time.sleep(60)"]))
    with pytest.raises(RigFailedError, match=r"did not track within 0\.5 s"), run_rig(idle):
        pass


def test_a_mark_chooses_the_command_that_starts_the_service(tmp_path):
    """It was replaced by the option's default."""
    marked = 'import pytest\n\npytestmark = pytest.mark.abs_rig(service="false")\n\n\ndef test_x(abs_rig): ...\n'
    (tmp_path / "test_marked.py").write_text(marked, "utf-8")
    command = [sys.executable, "-m", "pytest", "-p", "abs_client.pytest_plugin", "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert "RigFailedError: the simulated rig ended with exit code 1" in done.stdout
