"""Preview of a tracker: the first frame with the object, and the same classes of the rim as in tracking."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from abs_service import config, wiring
from abs_service.tracker.detection.regions import box
from abs_service.tracker.detection.segmentation import detect_object
from abs_service.tracker.terms.depth.outline.rim_classes import RimClass
from abs_service.tracking.observer import Observer
from abs_service.tracking.plan import make_posterior
from abs_service.tracking.preview import PreviewError, preview
from drivers.contract.frame import FrameSet
from drivers.simulated.address import parse

TOML = """
version = 1
name = "bench"
[devices.sim]
uri = "simulated://sheet"
[sensors.tof]
device = "sim"
noise = { type = "tof_amplitude", sigma = [0.0015, 0.0005], sigma_amplitude = 9.0 }
[synchronisation]
reference = "tof/depth"
[trackers.sheet]
sensors = ["tof"]
model = { type = "nurbs" }
"""
SETTINGS = config.loads(TOML, "rig.toml", Path())
SIMULATION = parse("simulated://sheet?seed=1&sensors=tof&occluder=hand").build()
RIG = wiring.rig(SETTINGS, "sheet", {"tof": SIMULATION.heads["tof"].camera})
PLAN = wiring.plan(SETTINGS, "sheet")


def frame_sets(*exposures: int, empty: int = 0) -> Iterator[FrameSet]:
    """Frame sets of some exposures; the first `empty` ones have no returns."""
    frames = [frame for k in exposures for frame in SIMULATION.frames(k)]
    blind = {exposures[k] for k in range(empty)}
    seen = (replace(f, data=np.zeros_like(f.data), invalid=0.0) if f.seq in blind else f for f in frames)
    return wiring.synchroniser(SETTINGS, "sheet", RIG.sensors.values()).group(seen)


def test_mesh_and_selected_pixels_of_a_sheet():
    seen = preview(frame_sets(30), RIG, PLAN)
    assert seen.found is not None
    assert (seen.number, seen.reason) == (0, "")
    length, width, height = seen.found.extents
    # A sheet of 0.30 × 0.20 m; the mesh ends up to a cell inside of it.
    assert 0.26 < length < 0.31
    assert 0.16 < width < 0.21
    assert height < 0.03
    assert seen.selected.sum() == pytest.approx(2700, rel=0.1)
    place = np.floor(seen.camera.project(seen.found.vertices) + 0.5).astype(int)
    assert seen.selected[place[:, 1], place[:, 0]].mean() > 0.98
    assert np.mean(seen.found.classes == RimClass.FREE) > 0.9


@pytest.mark.parametrize("exposure", [30, 90])
def test_the_classes_are_those_of_the_tracker(exposure):
    (frames,) = frame_sets(exposure)
    seen = preview([frames], RIG, PLAN)
    observation = Observer(RIG).observe(frames)
    model = PLAN.model.build(detect_object(observation, RIG, "tof", PLAN.region.build(), PLAN.vertices))
    posterior, _ = make_posterior(PLAN, RIG, model, observation)
    (fit,) = posterior.observe(observation, posterior.motion.predict(observation.t_host_ns)).fits(model.rest)
    assert seen.found is not None
    free, occluded = (np.sum(seen.found.classes == rim_class) for rim_class in (RimClass.FREE, RimClass.OCCLUDED))
    assert (fit.rim.visible + fit.rim.occluded, fit.rim.covered) == (free, occluded)


def test_the_first_frame_with_the_object_is_shown():
    seen = preview(frame_sets(30, 31, 32, empty=2), RIG, PLAN)
    assert seen.found is not None
    assert seen.number == 2
    assert "no connected surface" in seen.reason


def test_without_an_object_the_last_frame_and_the_reason_are_shown():
    seen = preview(frame_sets(30, 31, empty=2), RIG, PLAN)
    assert (seen.number, seen.found, seen.selected.any()) == (1, None, np.False_)
    assert np.isnan(seen.distance).all()
    assert "no connected surface" in seen.reason


def test_a_mesh_that_cannot_be_made_leaves_the_selected_pixels():
    seen = preview(frame_sets(30), RIG, replace(PLAN, vertices=10))
    assert seen.found is None
    assert seen.selected.sum() > 2000
    assert "too small" in seen.reason


def test_without_a_depth_image_there_is_no_preview():
    with pytest.raises(PreviewError, match="no depth image from tof in 0 frame sets"):
        preview([], RIG, PLAN)


def test_a_surface_that_nothing_holds_is_told_before_it_is_tracked():
    """A part of a flat wall: no colour camera, and no free edge."""
    (frames,) = frame_sets(30)
    wall = {key: replace(f, data=np.full_like(f.data, f.data.max())) for key, f in frames.frames.items()}
    region = box.Settings((-0.2, -0.15, 0.0), (0.2, 0.15, 5.0))
    seen = preview([replace(frames, frames=wall)], RIG, replace(PLAN, region=region))
    assert seen.found is not None
    (doubt,) = seen.warnings
    assert doubt.startswith("it would begin DEGRADED: nothing holds the surface along itself")


def test_a_sheet_raises_no_doubts_and_the_whole_scene_does():
    assert preview(frame_sets(30), RIG, PLAN).warnings == ()
    everything = box.Settings((-9.0, -9.0, 0.0), (9.0, 9.0, 9.0))
    seen = preview(frame_sets(30), RIG, replace(PLAN, region=everything))
    assert any("is the region right?" in doubt for doubt in seen.warnings)
