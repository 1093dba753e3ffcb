from pathlib import Path

import numpy as np
import pytest

from abs_service import config
from calib import pose
from calib.camera import Camera
from tests.abs_service.config.sensors_file import SENSORS, loads


def test_optional_keys_have_defaults():
    made = loads(SENSORS)
    assert made.bus.endpoint == "tcp/127.0.0.1:7447"
    assert made.record.directory == Path("/rig/recordings")
    assert made.trackers == {}


def test_sensors_are_found_by_what_the_device_calls_its_heads():
    assert loads(SENSORS).heads("sim") == {"tof": "tof", "rgb": "color"}


def test_paths_start_from_the_folder_of_the_file(tmp_path):
    file = tmp_path / "rig.toml"
    file.write_text(SENSORS + '[record]\ndirectory = "takes"\n')
    assert config.load(file).record.directory == tmp_path / "takes"


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("replay://../a b.mcap".replace(" ", "%20"), "replay:///rig/../a%20b.mcap"),
        ("replay://takes/a.mcap?loop=1&speed=2", "replay:///rig/takes/a.mcap?loop=1&speed=2"),
        ("replay:///data/a.mcap", "replay:///data/a.mcap"),
        ("simulated://sheet?seed=1", "simulated://sheet?seed=1"),
    ],
)
def test_a_device_that_is_a_file_starts_from_the_folder_of_the_configuration(given, meant):
    assert loads(SENSORS.replace("simulated://sheet?seed=1", given)).devices["sim"].uri == meant


def test_the_effective_configuration_loads_to_an_equal_one_from_anywhere():
    turned = "{ rotation_vector = [0.1, -0.2, 0.3], translation = [0.05, 0.0, 0.0] }"
    made = loads(SENSORS + f"[sensors.tof.camera]\nT_rs = {turned}\n[record]\nrotate_s = 12.5\n")
    assert config.loads(config.to_toml(made), "again", Path("/elsewhere")) == made


def test_a_camera_table_replaces_what_it_names_and_nothing_else():
    factory = Camera(176, 144, 220.0, 220.0, 87.5, 71.5, T_rs=pose.from_rotation_vector((0, 0, 0.1), (1, 2, 3)))
    table = "[sensors.tof.camera]\nwidth = 320\nheight = 240\nfx = 300.0\nfy = 301.0\ncx = 160.0\ncy = 120.0\n"
    camera = loads(SENSORS + table + "lens = [0.1]\n").sensors["tof"].camera.applied_to(factory)
    assert (camera.width, camera.fy, camera.lens.coefficients[0]) == (320, 301.0, 0.1)
    np.testing.assert_array_equal(camera.T_rs, factory.T_rs)
    assert loads(SENSORS).sensors["tof"].camera.applied_to(factory).calib_id == factory.calib_id
    fisheye = (
        loads(SENSORS + table + 'lens_model = "fisheye"\nlens = [0.1]\n').sensors["tof"].camera.applied_to(factory)
    )
    assert (fisheye.lens.name, fisheye.lens.coefficients.tolist()) == ("fisheye", [0.1, 0, 0, 0])


def test_a_pose_may_be_a_matrix():
    T_rs = pose.from_rotation_vector((0.3, 0.2, -0.1), (0.05, 0.0, 0.01))
    made = loads(SENSORS + f"[sensors.tof.camera]\nT_rs = {T_rs.tolist()}\n")
    table = made.sensors["tof"].camera.T_rs
    assert table is not None
    np.testing.assert_allclose(table.matrix(), T_rs, atol=1e-12)
