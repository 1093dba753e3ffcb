"""Real recordings: a toy, a sponge, a sheet, an O3R's own σ, an Azure Kinect; and what the figures are made of."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from calib.camera import Camera
from evaluation.experiment import Context, UnavailableError
from evaluation.inputs import changed_paper, recordings
from evaluation.inputs.recordings import azure, kinect_paper, kinect_paper_report, sigma_image, sigma_report
from evaluation.inputs.recordings.agreement import agreement
from evaluation.inputs.recordings.toy import dropouts, sponge_report, toy

CAMERA = Camera(40, 30, 40.0, 40.0, 19.5, 14.5)


def test_a_mesh_that_is_half_the_object_and_too_near_agrees_by_as_much():
    z = np.full((30, 40), 1.0)
    distance = (z * CAMERA.lookup.ray_length).astype(np.float32)
    mask = np.zeros((30, 40), bool)
    mask[5:25, 10:30] = True
    x, y = np.meshgrid(np.linspace(-0.2, 0.0, 9), np.linspace(-0.2, 0.2, 9))
    vertices = np.stack([x, y, np.full_like(x, 0.99)], axis=-1).reshape(-1, 3)
    corners = np.arange(72).reshape(8, 9)[:, :-1].ravel()
    faces = np.concatenate([np.stack([corners, corners + 9, corners + 1], axis=-1),
                            np.stack([corners + 1, corners + 9, corners + 10], axis=-1)])  # fmt: skip
    found = agreement(vertices, faces, distance, mask, CAMERA)
    assert found.forward_mm == pytest.approx(10, abs=4)  # what half a pixel beside the vertex is farther away, besides
    assert 0.4 < found.covered < 0.6
    assert found.inside > 0.8
    assert 10 < found.backward_mm < 60  # half of the points are beside the mesh


def test_a_search_within_the_rate_misses_nothing_and_one_that_is_not_misses_what_it_must():
    kept = dropouts.pace([900.0, *[30.0] * 20])
    assert (kept.missed, len(kept.age_ms)) == (0, 20)
    assert kept.age_ms == pytest.approx(30)
    slow = dropouts.pace([900.0, *[50.0] * 200])
    assert slow.missed == pytest.approx(200 / 3, abs=2)  # two frames of three can be tracked
    assert slow.age_ms.max() < 50 + 1000 / 30


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_real_toy_is_tracked_within_the_goals(data_set: Callable[[str], Path]) -> None:
    sequence = toy.Toy(data_set(toy.FOLDER), 30)
    frames = list(sequence.follow(time.process_time_ns, lambda k, frames: None if k in (12, 20, 21) else frames))
    medians, worst = toy.medians(frames), toy.worst(frames)
    assert [frame.index for frame in frames] == [k for k in range(30) if k not in (12, 20, 21)]
    assert all(frame.tracking for frame in frames)
    assert max(medians.forward_mm, medians.backward_mm) < 1.3
    assert max(worst.forward_mm, worst.backward_mm) < 2
    assert medians.covered > 0.85
    assert worst.inside > 0.95


@pytest.mark.slow
def test_a_real_sponge_keeps_its_mesh(data_set: Callable[[str], Path]) -> None:
    found = sponge_report.findings(data_set(toy.FOLDER), 6, lambda text: None).values["sponge"]
    assert max(*found["forward_mm"], *found["backward_mm"]) < 1
    assert max(found["off"]) == 0
    assert found["drift_px"][0] == pytest.approx(0, abs=1e-3)  # corners are bound where they are seen
    assert max(found["drift_px"]) < 0.5
    assert min(found["corners"]) >= 10


@pytest.mark.slow
def test_real_paper_is_where_it_was_measured(data_set: Callable[[str], Path]) -> None:
    found = kinect_paper_report.findings(data_set(kinect_paper.FOLDER), 3, 1, lambda text: None)
    run = found.values["kinect_paper"][kinect_paper.CELLS[0].name]
    assert run["number"] == [16, 24]
    assert run["status"] == ["TRACKING", "TRACKING"]
    assert max(run["median_mm"]) < 3


@pytest.mark.slow
def test_factor_and_floor_make_likely_what_the_sensor_s_own_deviations_do_not(data_set: Callable[[str], Path]) -> None:
    found = sigma_report.findings(data_set(sigma_report.FOLDER), 0, rounds=1)
    rows = found.values["o3r"]
    fitted, reported_sigma = rows[sigma_image.FITTED], rows[sigma_image.CLAIMED]
    assert fitted["log_likelihood"] > reported_sigma["log_likelihood"] + 1
    assert 0.85 < fitted["within_95"] < 0.99
    assert reported_sigma["within_95"] < 0.7


@pytest.mark.slow
def test_a_real_frame_s_colours_fit_its_amplitudes(data_set: Callable[[str], Path]) -> None:
    pytest.importorskip("av", reason="PyAV reads the recording")
    found = azure.findings(data_set(azure.FOLDER)).values["azure"]
    assert found["edges"] > 1.3
    assert found["forward_mm"] < 2


def test_without_recordings_the_experiment_says_what_it_needs(tmp_path: Path) -> None:
    for data in (None, tmp_path):
        with pytest.raises(UnavailableError, match="sl_rgbd_deform_petit"):
            recordings.run(recordings.QUICK, Context(0, data))


@pytest.mark.slow
def test_the_truth_stays_where_it_is_in_changed_images(data_set: Callable[[str], Path]) -> None:
    settings = changed_paper.Settings(frames=4, changes=len(changed_paper.CHANGES))
    found = changed_paper.run(settings, Context(0, data_set(kinect_paper.FOLDER).parent, lambda text: None))
    assert len(found.values["changes"]) == sum(len(change.cells) for change in changed_paper.CHANGES)
    errors = {goal.name.partition(": ")[2]: goal.value for goal in found.goals}
    assert errors[f"error of a frame, the worst of {len(found.values['changes'])}"] < 5  # a pixel of the coarsest
