"""Every noise model of depth tracks the demo's sheet from a TOML file, the maps from files beside it."""

import re
from importlib import resources

import numpy as np
import pytest

from abs_service import config, plugins
from abs_service.commands import plans
from abs_service.tracker.estimate import Status
from abs_service.tracker.optimizers import cma
from abs_service.tracking import Tracking
from calib.noise.pixel_polynomial import PixelPolynomial
from calib.noise.region_polynomial import RegionPolynomial, blocks
from drivers.simulated.time_of_flight import SIGMA_POLYNOMIAL
from tests.tracker.driving import TRACKER, default_plan, drive, mean_errors, simulate

SHEET = simulate("simulated://sheet?seed=1")
TABLES = {
    "constant": "sigma = 0.0045",
    "gaussian_polynomial": "sigma = [[0.002, 0.0], [0.0025, 0.0]]",
    "structured_light": "noise = 4e-3\nstep = 0.0",
    "tof_amplitude": "sigma = [0.0015, 0.0005]\nsigma_amplitude = 9.0",
    "pixel_polynomial": 'file = "pixels.npz"',
    "region_polynomial": 'file = "regions.npz"',
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the noise of every pixel, and of every region of 16 × 16 pixels."""
    made = tmp_path_factory.mktemp("rig")
    sigma = np.array(SIGMA_POLYNOMIAL)
    domain = np.array([0.1, 5.0]), np.array([400.0, 10_000.0])
    labels = blocks(144, 176, 16)
    tables = np.repeat(sigma[..., None], int(labels.max()) + 1, axis=-1)
    RegionPolynomial(labels, tables, 0 * tables, *domain).save(made / "regions.npz")
    maps = np.tile(sigma[..., None, None], (1, 1, 144, 176))
    PixelPolynomial(maps, 0 * maps, *domain).save(made / "pixels.npz")
    return made


def test_there_is_a_table_for_every_type():
    assert TABLES.keys() <= set(plugins.available("calib.noise"))


@pytest.mark.parametrize("name", TABLES)
def test_a_sheet_is_tracked_with_the_noise_that_a_file_names(folder, name):
    demo = resources.files("abs_service.rigs").joinpath("demo.toml").read_text(encoding="utf-8")
    noise = f'[sensors.tof.noise]\ntype = "{name}"\n{TABLES[name]}\n\n'
    toml = re.sub(r"\[sensors\.tof\.noise\].*?(?=\[sensors\.color\])", noise, demo, flags=re.DOTALL)
    rig = plans.rig(
        config.loads(toml, "rig.toml", folder), TRACKER, {name: head.camera for name, head in SHEET.heads.items()}
    )
    tracking = Tracking(rig, default_plan(optimizer=cma.Settings(generations=2)))
    steps = list(drive(tracking, SHEET, range(40, 52)))
    assert {step.estimate.status for step in steps} == {Status.TRACKING}
    assert mean_errors(steps)[0] < 4
