"""Recordings of other programs are imported with their own calibration, and tracked."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from abs_service.supervision.exit_codes import Exit
from tests.sample.sample import GOLDEN
from tests.system.running import abs_service

SAMPLE_OAK = Path(__file__).parents[2] / "recordings" / "sample_oak"

#: One head and a surface of 4 × 4 control points on whatever is nearest.
RIG = """\
version = 1
name = "imported"
[devices.camera]
uri = "replay://any.mcap"
[sensors.{head}]
device = "camera"
noise = {noise}
[synchronisation]
reference = "{head}/depth"
tolerance_ms = 12.0
[trackers.thing]
sensors = ["{head}"]
[trackers.thing.model]
type = "nurbs"
control_points = [4, 4]
degree = 2
[trackers.thing.region]
type = "nearest"
"""
CONSTANT = '{ type = "constant", sigma = 0.005 }'
BY_AMPLITUDE = """{ type = "gaussian_polynomial", amplitudes = [400.0, 10000.0],
  sigma = [[1.0425e-2, -2.8187e-6, 3.5261e-10, -1.5195e-14], [5.0e-4, 0.0, 0.0, 0.0]] }"""


def tracked(
    folder: Path, recording: Path, layout: str, head: str = "depth", noise: str = CONSTANT, reason: str = ""
) -> list[np.ndarray]:
    """Control points (n, 3) of every exposure after import and replay; with a reason, all of them are DEGRADED."""
    (folder / "rig.toml").write_text(RIG.format(head=head, noise=noise.replace("\n", " ")))
    options = ("--rig", folder / "rig.toml", "--out", folder / "in.mcap")
    imported = abs_service("import", recording, "--layout", layout, *options)
    assert imported.returncode == Exit.OK, imported.stderr
    replayed = abs_service("replay", folder / "in.mcap", "--json", "--out", folder / "out.mcap")
    assert replayed.returncode == Exit.OK, replayed.stderr
    estimates = [json.loads(line) for line in replayed.stdout.splitlines()]
    assert {estimate["status"] for estimate in estimates} == {"DEGRADED" if reason else "TRACKING"}
    assert all(reason in "".join(estimate["reasons"]) for estimate in estimates)
    return [np.reshape(estimate["theta"], (-1, 3)) for estimate in estimates]


@pytest.mark.slow
def test_a_recording_of_depthai_shows_what_the_simulator_did(tmp_path: Path) -> None:
    """The same exposures as in the sample of abs-service, rounded to millimetres along z, give the same surface."""
    estimates = tracked(tmp_path, SAMPLE_OAK, "oak", "tof", BY_AMPLITUDE)
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))["theta"][: len(estimates)]
    away_mm = [1e3 * np.abs(theta - np.reshape(same, (-1, 3))).mean() for theta, same in zip(estimates, golden)]
    assert len(estimates) == 6
    assert max(away_mm) < 10


@pytest.mark.slow
@pytest.mark.parametrize(
    ("layout", "file", "exposures", "distances", "reason"),
    [
        ("o3r", "tof_ifm_o3r/O3RBuffer.data", 1, (0.19, 0.6), ""),
        ("azure", "tof_azure_kinect_pyk4a/recording.mkv", 1, (0.2, 0.6), ""),
        # The border cuts it, and there are no colours.
        (
            "realsense",
            "realsense_bag/single_depth_color_640x480.bag",
            2,
            (0.3, 0.6),
            "nothing holds the surface along itself",
        ),
    ],
)
def test_real_recordings_are_tracked(
    data_set: Callable[[str], Path],
    tmp_path: Path,
    layout: str,
    file: str,
    exposures: int,
    distances: tuple[float, float],
    reason: str,
) -> None:
    pytest.importorskip({"azure": "av", "realsense": "rosbags"}.get(layout, "numpy"), reason="make all")
    estimates = tracked(tmp_path, data_set(file), layout, reason=reason)
    assert len(estimates) == exposures
    for theta in estimates:
        near, far = distances
        assert near < np.median(np.linalg.norm(theta, axis=1)) < far
