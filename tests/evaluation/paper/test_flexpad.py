"""E2 in seconds: Θ is found where it is known, and a pose error is told from the mesh alone."""

import numpy as np
import pytest

from abs_service.tracker.detection.shapes.sheet_mesh import Sheet
from calib import pose
from evaluation.experiment import Context
from evaluation.paper import flexpad


def test_the_pose_error_of_a_flat_grid_is_how_far_it_was_turned_and_moved():
    T_rp = pose.from_rotation_vector([0.3, -0.2, 0.5], [0.1, 0.0, 1.0])
    turned = pose.from_rotation_vector([0.01, 0.02, -0.02], [0.0, 0.0, 0.0])
    moved = T_rp.copy()
    moved[:3, :3] = turned[:3, :3] @ T_rp[:3, :3]
    moved[:3, 3] += [0.0, 0.003, -0.004]
    flat = Sheet(moved, 0.3, 0.2).mesh(300).vertices
    rotation_mrad, translation_mm = flexpad.pose_error(flat, T_rp)
    assert rotation_mrad == pytest.approx(30.0, rel=0.01)
    assert translation_mm == pytest.approx(5.0, rel=0.01)


@pytest.mark.slow
def test_bends_are_found_where_they_are_known():
    findings = flexpad.run(flexpad.QUICK, Context(0))
    for goal in findings.goals[:2]:  # ratios; the others are for more and longer sequences
        assert goal.met, goal
    for figures in findings.values.values():
        assert figures["likelihood"]["bend"] < 0.1
        assert figures["likelihood"]["surface_mm"] < 1.5
    likelihood, bounded = (
        np.mean([figures[name]["surface_mm"] for figures in findings.values.values()])
        for name in ("likelihood", "Euclidean, bounded")
    )
    assert likelihood < bounded
