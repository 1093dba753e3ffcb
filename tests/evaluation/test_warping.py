"""The goals of the input warping: 95 % filled, bias 0.1 mm, and 1.5 mm for 95 % of the pixels at a noise of 1 mm."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from calib.warp.pictures import PictureLookup
from tests.evaluation import azure_kinect, warping


@pytest.mark.slow
@pytest.mark.parametrize("scene", warping.SCENES)
def test_more_is_filled_and_it_is_more_right_than_by_opencv(scene: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warping, "SCENES", {scene: warping.SCENES[scene]})
    monkeypatch.setattr(warping, "ROUNDS", 1)
    with ThreadPoolExecutor(2) as pool:
        rows = {row.method: row for row in warping.simulated([1], pool)}
    for ours in (rows["mesh"], rows["mesh, 2 threads"]):
        assert ours.fill >= 95
        assert abs(ours.bias_mm) <= 0.1
        assert ours.p95_mm <= 1.5
        assert ours.p95_mm < min(rows[name].p95_mm for name in rows if name.startswith("cv2"))
        assert ours.fill > rows["cv2.registerDepth"].fill


@pytest.mark.slow
def test_a_real_frame_s_colours_fit_its_amplitudes(shared_data: Path) -> None:
    """Edges of the infra-red amplitudes are edges of the colours there: they correlate, and less if moved by 8 px."""
    pytest.importorskip("av", reason="PyAV reads the recording")
    folder = shared_data / "tof_azure_kinect_pyk4a"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    shot = azure_kinect.read(folder)
    sight = PictureLookup(shot.depth, shot.color).look(shot.distance)
    grey = sight.blended(shot.rgb).mean(axis=-1)
    assert np.mean(sight.visible[np.isfinite(shot.distance)]) > 0.8

    def agreement(right: int, down: int) -> float:
        moved = np.roll(grey, (down, right), (0, 1))
        edges = [np.hypot(*np.gradient(np.log(image + 1))) for image in (moved, shot.amplitude)]
        known = np.isfinite(edges[0]) & np.isfinite(shot.distance)
        return float(np.corrcoef(edges[0][known], edges[1][known])[0, 1])

    there = agreement(0, 0)
    assert there > 1.3 * max(agreement(8, 0), agreement(-8, 0), agreement(0, 8), agreement(0, -8))
