"""The rigs that come with the service and those in examples/rigs are understood, all of them."""

from pathlib import Path

import pytest

from abs_service import config
from drivers import simulated

EXAMPLES = sorted((Path(__file__).parents[3] / "examples" / "rigs").glob("*.toml"))


def test_the_default_rig_tracks_and_records_below_where_the_user_is(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rig = config.load_default()
    assert list(rig.trackers) == ["sheet"]
    assert rig.record.directory == tmp_path / "recordings"
    assert rig.reference("sheet") == ("tof", "depth")


def test_the_default_rig_names_heads_that_its_device_has():
    rig = config.load_default()
    device = simulated.open_device(rig.devices["sim"].uri, lambda: 0)
    assert rig.heads("sim").keys() <= device.cameras.keys()


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_understood_and_survives_the_way_to_the_children(path):
    rig = config.load(path)
    assert config.loads(config.to_toml(rig), "again", Path("/elsewhere")) == rig


def test_there_are_examples():
    assert EXAMPLES
