"""A search begins where images show the print of the mesh."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.posterior.search_start import search_start
from abs_service.tracker.terms.patches import patches_of
from tests.abs_service.tracking.driving import frame_posterior_of
from tests.abs_service.tracking.test_session import RIG, SHEET, drive, tracking


@pytest.fixture(scope="module")
def observed() -> tuple[FramePosterior, np.ndarray]:
    """The cost of a frame of the simulated sheet, and its estimate."""
    *_, step = drive(one := tracking(vertices=300), SHEET, [0, 1])
    assert one.model is not None
    exposed = SHEET.expose(1)[0]
    frame = frame_posterior_of(one.model, RIG, exposed, exposed)
    return frame, step.estimate.theta


def predicting(frame: FramePosterior, theta: np.ndarray) -> FramePosterior:
    """The same cost with another prediction, and a narrow prior around it, as after a calm time."""
    return frame.with_motion(
        replace(frame.motion, theta=theta, speed=frame.motion.settings.minimum_speed, is_first=False)
    )


def test_a_right_prediction_is_kept(observed):
    frame, theta = observed
    calm = predicting(frame, theta)
    under, start = search_start(calm, patches_of(frame.model.mesh))
    assert under is calm
    assert start is calm.motion.theta


@pytest.mark.parametrize("jump_m", [(0.01, 0, 0), (0, -0.012, 0), (-0.015, 0.01, 0), (0.02, 0.02, 0)])
def test_a_print_beside_the_prediction_is_where_the_search_begins(observed, jump_m):
    frame, theta = observed
    jacobian, vertices = frame.model.sparse_jacobian(theta).dense, frame.surfaces.deform(theta[None]).vertices[0].T
    moved = theta + np.linalg.lstsq(jacobian.reshape(-1, len(theta)), np.tile(jump_m, len(vertices)), rcond=None)[0]
    calm = predicting(frame, moved)
    under, start = search_start(calm, patches_of(frame.model.mesh))
    off = np.linalg.norm(frame.surfaces.deform(start[None]).vertices[0].T - vertices, axis=1)
    assert np.median(off) < 0.3 * np.linalg.norm(jump_m)
    assert under.motion.speed > calm.motion.speed  # a prior that allows for the jump
