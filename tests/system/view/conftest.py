"""The rig of these tests is slow, which leaves the processors to a browser that draws without a graphics card."""

import pytest

from tests.system.running import write_rig


@pytest.fixture
def rig_file(tmp_path, endpoint):
    """Configuration of the demo rig, at a third of its rate and speed."""
    path = write_rig(tmp_path / "rig.toml", endpoint)
    path.write_text(path.read_text("utf-8").replace("sheet?seed=1", "sheet?seed=1&rate=10&speed=0.33"), "utf-8")
    return path
