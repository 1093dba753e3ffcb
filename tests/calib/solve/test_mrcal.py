"""Comparison with mrcal on the same corners and model: projections, and what both say of their uncertainty."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evaluation.calibration import mrcal_comparison, published_boards


@pytest.mark.slow
def test_projections_are_those_of_mrcal_within_what_both_say(data_set: Callable[[str], Path]) -> None:
    """Thirteen views of a real camera, compared where boards were seen and up to a motion of the camera."""
    if not mrcal_comparison.is_installed():
        pytest.skip("needs Debian's python3-mrcal")
    views = [view for view in published_boards.stereo(data_set("calib_opencv_stereo")) if view.sensor == "left"]
    found = mrcal_comparison.compared(views, (640, 480), published_boards.CHESSBOARD.square)
    own, other, differences = found.own, found.other, found.differences
    print(f"rms {found.rms_px:.3f} px, difference {np.median(differences):.4f}, {differences.max():.4f} px")
    print(f"deviation: ours {np.median(own):.4f} px, mrcal's {np.median(other):.4f} px")
    assert np.median(differences / np.hypot(own, other)) < 1
    assert np.all(differences < 3 * np.hypot(own, other))
    assert np.median(own) > np.median(other), "ours allows for errors that the corners of a view have in common"
