"""Parts of a tracker from its configuration: mistakes that only show when cameras are known."""

import re
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from abs_service import config, wiring
from calib.camera import Camera
from calib.no_return import NoReturn

TOF = Camera(176, 144, 220.0, 220.0, 87.5, 71.5)
COLOR = Camera(320, 240, 340.0, 340.0, 159.5, 119.5)


def test_a_tracker_that_does_not_exist_is_answered_with_those_that_do():
    with pytest.raises(wiring.PlanError, match=r'no tracker "sheeet".*sheet'):
        wiring.plan(config.load_default(), "sheeet")


def test_a_sensor_without_a_camera_is_named():
    with pytest.raises(wiring.PlanError, match=r'"color" of tracker "sheet" has no camera'):
        wiring.rig(config.load_default(), "sheet", {"tof": TOF})


def test_the_outlier_settings_of_a_sensor_are_published_with_its_noise_model():
    text = resources.files("abs_service.config").joinpath("demo.toml").read_text(encoding="utf-8")
    own = text.replace("[sensors.tof]\n", "[sensors.tof]\noutlier_share = 0.2\nrange_m = 7.5\nno_return.grazing = 2\n")
    rig = wiring.rig(config.loads(own, "own.toml", Path()), "sheet", {"tof": TOF, "color": COLOR})
    tof, color = rig.sensors["tof"], rig.sensors["color"]
    assert (tof.outlier_share, tof.range_m) == (0.2, 7.5)
    assert (color.outlier_share, color.range_m) == (None, None)
    assert (tof.no_return, color.no_return) == (NoReturn(grazing=2.0), NoReturn())


def test_noise_maps_of_another_image_size_are_refused_before_they_are_used(tmp_path):
    maps = {"sigma": np.full((1, 1, 240, 320), 0.005), "mu": np.zeros((1, 1, 240, 320))}
    np.savez(tmp_path / "maps.npz", **maps, distances=np.array([0.1, 5.0]), amplitudes=np.array([0.0, 1e4]))
    demo = resources.files("abs_service.config").joinpath("demo.toml").read_text(encoding="utf-8")
    noise = '[sensors.tof.noise]\ntype = "pixel_polynomial"\nfile = "maps.npz"\n'
    toml = re.sub(r"\[sensors\.tof\.noise\].*?(?=\[sensors\.color\])", noise, demo, flags=re.DOTALL)
    with pytest.raises(wiring.PlanError, match=r"sensors.tof.noise.file.* 320 × 240 .* 176 × 144"):
        wiring.rig(config.loads(toml, "maps.toml", tmp_path), "sheet", {"tof": TOF, "color": COLOR})


def test_vertex_offsets_need_a_model_with_offsets():
    demo = resources.files("abs_service.config").joinpath("demo.toml").read_text(encoding="utf-8")
    own = demo.rstrip() + "\n\n[trackers.sheet.vertex_offsets]\nrandom_walk = 1e-4\n"
    assert wiring.plan(config.loads(own, "own.toml", Path()), "sheet").vertex_offsets.random_walk == 1e-4
    stiff = own.replace('type = "nurbs"\n', 'type = "rigid"\n')
    with pytest.raises(wiring.PlanError, match=r'vertex_offsets\.random_walk = 0\.0001 needs .*"nurbs", not "rigid"'):
        wiring.plan(config.loads(stiff, "own.toml", Path()), "sheet")
