"""Warm-up: nothing is left to be compiled or loaded when the first frames come."""

import json
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from abs_service import config, wiring
from abs_service.tracking.warmup import board as warmup
from abs_service.tracking.warmup.board import warm_up
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.noise.pixel_polynomial import PixelPolynomial

CAMERA = Camera(2, 2, 2.0, 2.0, 0.5, 0.5)

#: Tracks real frames after the warm-up and tells which kernels had how many forms before and afterwards.
PROGRAM = """
import dataclasses, gc, json, sys
from numba.core.dispatcher import Dispatcher
from pathlib import Path
from abs_service import config, wiring
from abs_service.config import plugins
from abs_service.tracking.observer import streams
from abs_service.tracking.session import TrackingSession
from abs_service.pairing.synchroniser import Synchroniser
from abs_service.tracking.warmup.board import warm_up
from drivers.simulated import address

settings = config.load_default()
table = json.loads(sys.argv[1])
parts = {key: plugins.load(f"abs_service.tracker.{package}", table[key], Path())
         for key, package in [("model", "models"), ("synthesis", "synthesis")] if key in table}
plan = dataclasses.replace(wiring.plan(settings, "sheet"), **parts)
simulation = address.parse(table.get("uri", settings.devices["sim"].uri) + table.get("keys", "")).build()
rig = wiring.rig(settings, "sheet", {name: head.camera for name, head in simulation.heads.items()})
warm_up(rig, plan)

exposures = [simulation.expose(k)[0] for k in range(8)]

OURS = "abs_service", "drivers", "calib"

def forms():
    return {f.py_func.__module__ + "." + f.py_func.__qualname__: len(f.signatures) for f in gc.get_objects()
             if isinstance(f, Dispatcher) and f.py_func.__module__.partition(".")[0] in OURS}

before = forms()
tracking = TrackingSession(rig, plan)
synchroniser = Synchroniser(settings.reference("sheet"), streams(rig.sensors.values()), 10**7)
for frames in exposures:
    for frame in frames:
        for frame_set in synchroniser.add(frame):
            estimate = tracking.track(frame_set, lambda: True)
print(json.dumps([before, forms(), estimate.status]))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "parts",
    [
        {"model": {"type": "nurbs", "control_points": [4, 4]}},
        {"model": {"type": "flexpad", "width_m": 0.3, "height_m": 0.2}},
        {"model": {"type": "posed", "shape": {"type": "flexpad"}}},
        {"model": {"type": "gravity"}, "uri": "simulated://strip?seed=1"},
        {"synthesis": {"type": "sparse"}, "keys": "&lens=0.25"},
        {"synthesis": {"type": "sparse"}, "keys": "&lens_model=fisheye"},
        {"synthesis": {"type": "undistorted"}, "keys": "&lens=0.25"},
        {"synthesis": {"type": "warped"}, "keys": "&lens=0.25"},
        {"synthesis": {"type": "dense", "step": 2}, "keys": "&lens=0.25"},
    ],
    ids=lambda parts: next(iter(parts.values()))["type"],
)
def test_real_frames_need_no_kernel_that_the_warm_up_did_not_prepare(parts):
    command = [sys.executable, "-c", PROGRAM, json.dumps(parts)]
    out = subprocess.run(command, check=True, capture_output=True, text=True, timeout=200)
    before, after, status = json.loads(out.stdout)
    assert status == "TRACKING"
    assert before == after
    assert sum(before.values()) >= 4


def test_a_noise_map_that_is_smaller_than_the_nominal_image_does_no_harm(monkeypatch):
    statuses = []

    class Recorded(warmup.TrackingSession):
        def track(self, frames, in_time):
            statuses.append((estimate := super().track(frames, in_time)).status)
            return estimate

    monkeypatch.setattr(warmup, "TrackingSession", Recorded)
    settings = config.load_default()
    plan = wiring.plan(settings, "sheet")
    small = np.full((1, 1, 2, 2), 0.01)
    tof = PixelPolynomial(small, np.zeros_like(small), np.array([0.0, 9.0]), np.array([0.0, 1.0]))
    rig = wiring.rig(settings, "sheet", dict.fromkeys(("tof", "color"), CAMERA))
    warm_up(replace(rig, sensors=dict(rig.sensors) | {"tof": replace(rig.sensors["tof"], noise=tof)}), plan)
    assert statuses[:2] == 2 * ["TRACKING"]


#: Loads what the cache has and may compile the rest; tells whether all was there, and how many kernels have forms.
LOADING = """
import gc, json, sys
from numba.core.dispatcher import Dispatcher
from abs_service import config, wiring
from abs_service.tracking.warmup.board import load_cached, warm_up
from calib.camera import Camera

settings = config.load_default()
plan, noises = wiring.plan(settings, "sheet"), wiring.noises(settings, "sheet")
loaded = load_cached(noises, plan)
if "compile" in sys.argv:
    cameras = dict.fromkeys(("tof", "color"), Camera(64, 48, 60.0, 60.0, 31.5, 23.5))
    warm_up(wiring.rig(settings, "sheet", cameras), plan)
ours = [f for f in gc.get_objects() if isinstance(f, Dispatcher) and f.py_func.__module__.startswith("abs_service.")]
print(json.dumps([loaded, sum(bool(f.signatures) for f in ours)]))
"""


@pytest.mark.slow
def test_cached_kernels_are_loaded_before_the_cameras_are_known_and_none_is_compiled(tmp_path):
    def run(*arguments, **variables):
        command = [sys.executable, "-c", LOADING, *arguments]
        done = subprocess.run(command, check=True, capture_output=True, text=True, env=os.environ | variables)
        return json.loads(done.stdout)

    assert run(NUMBA_CACHE_DIR=str(tmp_path)) == [False, 0]
    assert not list(tmp_path.rglob("*.nbc"))
    run("compile")  # into the cache that other tests fill as well
    loaded, kernels = run()
    assert loaded
    assert kernels > 10


@pytest.mark.parametrize(("lenses", "expected"), [([Lens(), Lens()], True), ([Lens(), Lens(np.array([0.1]))], False)])
def test_a_lens_that_distorts_needs_other_kernels(lenses, expected):
    settings = config.load_default()
    cameras = {name: replace(CAMERA, lens=lens) for name, lens in zip(("tof", "color"), lenses, strict=True)}
    assert warmup.is_undistorted(wiring.rig(settings, "sheet", cameras)) == expected
