"""Acceptance on real data: PrimeSense-type frames of a soft toy that a hand squeezes."""

from pathlib import Path

import pytest

from tests.evaluation import soft_toy

LARGEST_RESIDUAL_MM = 3.0
LEAST_INSIDE = 0.95


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_real_toy_is_tracked_within_three_millimetres_in_every_frame(shared_data: Path, tmp_path: Path) -> None:
    data = shared_data / "sl_rgbd_deform_petit"
    if not data.is_dir():
        pytest.skip(f"{data} is not there")
    frames = soft_toy.track(data, tmp_path)
    print(soft_toy.table(frames))
    assert len(frames) == 120
    assert {frame.status for frame in frames} == {"TRACKING"}
    assert max(frame.agreement.forward_mm for frame in frames) <= LARGEST_RESIDUAL_MM
    assert max(frame.agreement.backward_mm for frame in frames) <= LARGEST_RESIDUAL_MM
    assert min(frame.agreement.inside for frame in frames) >= LEAST_INSIDE
