"""The goals of the input warping: 95 % filled, bias 0.1 mm, and 1.5 mm for 95 % of the pixels at a noise of 1 mm."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from evaluation.experiment import Context
from evaluation.inputs import warping
from evaluation.inputs.warping import comparison


@pytest.mark.slow
@pytest.mark.parametrize("scene", comparison.SCENES)
def test_more_is_filled_and_it_is_more_right_than_by_opencv(scene: str) -> None:
    with ThreadPoolExecutor(2) as pool:
        rows = {row.method: row for row in comparison.simulated([scene], [1], 1, pool)}
    for ours in (rows["mesh"], rows["mesh, 2 threads"]):
        assert ours.fill >= 95
        assert abs(ours.bias_mm) <= 0.1
        assert ours.p95_mm <= 1.5
        assert ours.p95_mm < min(rows[name].p95_mm for name in rows if name.startswith("cv2"))
        assert ours.fill > rows["cv2.registerDepth"].fill


@pytest.mark.slow
def test_warped_input_tracks_the_surface_as_well_and_says_so_without_the_real_frame() -> None:
    found = warping.run(replace(warping.QUICK, frames=6, rounds=1), Context(0))
    assert not found.failed
    rows = found.values["tracked"]
    # By where in the pixels its vertices lie, the warped one scatters by a third.
    assert rows["warped"]["surface_mm"] < 1.5 * rows["sparse"]["surface_mm"]
    assert found.sections[-1].blocks == ("tof_azure_kinect_pyk4a is not in the data folder.",)
