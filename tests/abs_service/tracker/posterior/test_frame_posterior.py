"""A search begins where images show the print of the mesh."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from abs_service.tracker.objectives.base import ObservedObjective
from abs_service.tracker.posterior.frame_posterior import FramePosterior
from abs_service.tracker.terms.places.keypoints import Recognized
from tests.abs_service.tracking.driving import frame_posterior_of, simulate
from tests.abs_service.tracking.test_session import RIG, SHEET, drive, rig_of, tracking

#: The same sheet with a print of irregular marks.
PRINTED = simulate("simulated://sheet?seed=1&texture=paper")


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


def moved(frame: FramePosterior, theta: np.ndarray, jump_m: tuple[float, float, float]) -> np.ndarray:
    """Parameters (dim,) of the mesh at theta (dim,) that has moved by a jump (3,) [m]."""
    jacobian = frame.surfaces.model.sparse_jacobian(theta).dense
    jumps = np.tile(jump_m, jacobian.shape[0])
    return theta + np.linalg.lstsq(jacobian.reshape(-1, len(theta)), jumps, rcond=None)[0]


def away_m(frame: FramePosterior, theta: np.ndarray, other: np.ndarray) -> float:
    """Median distance of the vertices of two parameters (dim,) [m]."""
    one, two = (frame.surfaces.deform(part[None]).vertices[0].T for part in (theta, other))
    return float(np.median(np.linalg.norm(one - two, axis=1)))


def test_a_right_prediction_is_kept(observed):
    frame, theta = observed
    calm = predicting(frame, theta)
    assert calm.search_start() is calm.motion.theta


@pytest.mark.parametrize("jump_m", [(0.01, 0, 0), (0, -0.012, 0), (-0.015, 0.01, 0), (0.02, 0.02, 0)])
def test_a_print_beside_the_prediction_is_where_the_search_begins(observed, jump_m):
    frame, theta = observed
    calm = predicting(frame, moved(frame, theta, jump_m))
    start = calm.search_start()
    assert away_m(frame, start, theta) < 0.3 * np.linalg.norm(jump_m)
    assert calm.motion.is_too_narrow(start)  # a wider prior allows for the jump


def test_a_search_that_ended_at_the_print_ends_there(observed):
    frame, theta = observed
    assert predicting(frame, theta).shown_at(theta) is None


@pytest.mark.parametrize("jump_m", [(0.01, 0, 0), (0, -0.012, 0)])
def test_a_search_that_ended_beside_the_print_begins_anew_there(observed, jump_m):
    frame, theta = observed
    end = moved(frame, theta, jump_m)
    start = predicting(frame, end).shown_at(end)
    assert start is not None
    assert away_m(frame, start, theta) < 0.3 * np.linalg.norm(jump_m)


@pytest.mark.parametrize("jump_m", [(0.06, 0.05, 0), (-0.08, 0.03, 0.02)])
def test_distances_bring_the_mesh_near_a_print_that_is_out_of_reach(observed, jump_m):
    """Colours have drawn the search further than patches are shifted; by distances and outline the sheet is near."""
    frame, theta = observed
    predicted = predicting(frame, moved(frame, theta, (0.01, 0.008, 0.01)))
    end = moved(frame, theta, jump_m)
    start = predicted.shown_at(end)
    assert start is not None
    assert away_m(frame, start, theta) < 0.5 * away_m(frame, predicted.motion.theta, theta)


@pytest.fixture(scope="module")
def learnt() -> tuple[FramePosterior, np.ndarray]:
    """The same after the keypoints of the estimate were learnt."""
    *_, step = drive(one := tracking(vertices=300), PRINTED, [0, 1])
    assert one.model is not None
    exposed = PRINTED.expose(1)[0]
    frame = frame_posterior_of(one.model, rig_of(PRINTED), exposed, exposed)
    frame.learn(frame.surfaces.deform(step.estimate.theta[None]))
    return frame, step.estimate.theta


@pytest.mark.parametrize("jump_m", [(0.15, -0.1, 0), (-0.2, 0.05, 0.1)])
def test_a_print_is_recognised_however_far_it_is_from_the_prediction(learnt, jump_m):
    frame, theta = learnt
    far = predicting(frame, moved(frame, theta, jump_m))
    place = far.recognized()
    assert place is not None
    assert away_m(frame, place, theta) < 0.004
    assert away_m(frame, far.cold_start(), theta) < 0.004


def test_keypoints_tell_that_a_search_has_ended_where_the_print_is(learnt):
    frame, theta = learnt
    assert predicting(frame, theta).shown_at(theta) is theta


def test_without_keypoints_nothing_is_recognised(observed):
    assert observed[0].recognized() is None


@dataclass(frozen=True)
class WrongMatches:
    """The objective of a frame in which all keypoints are taken for others."""

    objective: ObservedObjective
    seed: int

    @property
    def recognized(self) -> list[Recognized]:
        (found,) = self.objective.recognized
        rng, few = np.random.default_rng(self.seed), np.s_[:14]
        seen = rng.uniform((0, 0), (found.camera.width, found.camera.height), (14, 2))
        return [replace(found, corners=found.corners[few], weights=found.weights[few], seen=seen)]

    def __getattr__(self, name: str) -> object:
        return getattr(self.objective, name)


def test_wrong_matches_are_no_place(learnt):
    frame, theta = learnt
    for seed in range(40):
        wrong = replace(predicting(frame, theta), objective=WrongMatches(frame.objective, seed))
        assert wrong.recognized() is None
        assert wrong.recognized_elsewhere(theta) is None
