"""The tables in docs/explanation/noise.md are valid models, and its example runs."""

import re
import tomllib
from pathlib import Path

import pytest

from abs_service.config import SensorTable, plugins
from calib.noise import pixel_polynomial

PAGE = (Path(__file__).parents[3] / "docs" / "explanation" / "noise.md").read_text(encoding="utf-8")
TABLES = {
    name: sensor
    for block in re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    for name, sensor in tomllib.loads(block)["sensors"].items()
}


def test_every_depth_model_has_a_table():
    assert sorted(table["noise"]["type"] for table in TABLES.values()) == plugins.available("calib.noise")


@pytest.mark.parametrize("name", TABLES)
def test_a_table_is_one_of_a_rig_file(name):
    noise = TABLES[name]["noise"]
    assert plugins.table(plugins.load("calib.noise", noise, Path())).items() >= {"type": noise["type"]}.items()


def test_the_sensor_s_own_keys_are_those_of_a_rig_file():
    table = {key: value for key, value in TABLES["tof"].items() if key != "noise"}
    assert SensorTable(**table).outlier_share == 0.1


def test_the_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(code, "docs/explanation/noise.md", "exec"), {})
    assert pixel_polynomial.Settings(tmp_path / "pixels.npz").build().shape == (24, 32)
    model, quality, likelihoods = capsys.readouterr().out.splitlines()
    assert model.startswith("TofAmplitude(sigma=(0.001")
    assert "within_95=0.9" in quality
    assert len(likelihoods.split()) == 2
