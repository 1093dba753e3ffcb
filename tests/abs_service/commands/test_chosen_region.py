"""The region with a chosen pixel keeps what the rig file says of surfaces, and its lines of TOML make it again."""

from dataclasses import replace
from pathlib import Path

import pytest

from abs_service import config
from abs_service.commands.parts import chosen_region
from abs_service.tracker.detection.regions import above_plane, box, distance, mask, nearest, seed
from abs_service.tracker.estimate import Status
from abs_service.tracking.session import TrackingSession
from abs_service.wire.commands import RefusedError
from tests.abs_service.tracking.driving import default_plan, drive, rig_of, simulate

PIXEL = (111, 133)
MASK = Path("/rigs/mask.png")


@pytest.mark.parametrize(
    ("region", "chosen"),
    [
        (nearest.Settings(0.02, within=MASK), seed.Settings(PIXEL, largest_step_m=0.02, within=MASK)),
        (distance.Settings(1.2, largest_step_m=0.03), seed.Settings(PIXEL, largest_step_m=0.03)),
        (above_plane.Settings(0.005), above_plane.Settings(0.005, PIXEL)),
        (above_plane.Settings(seed=(1, 2)), above_plane.Settings(seed=PIXEL)),
        (seed.Settings((1, 2), grow="color"), seed.Settings(PIXEL, grow="color")),
        (seed.Settings(color=(146, 50, 72), within=MASK), seed.Settings(PIXEL, within=MASK)),
        (seed.Settings(motion_s=2.0), seed.Settings(PIXEL)),
        (box.Settings((0, 0, 0), (1, 1, 1)), seed.Settings(PIXEL)),
        (mask.Settings(MASK), seed.Settings(PIXEL)),
    ],
)
def test_a_pixel_goes_into_the_region_and_back_into_the_rig_file(region, chosen):
    assert chosen_region.at_pixel(region, PIXEL) == chosen
    rig = config.load_default()
    name, tracker = next(iter(rig.trackers.items()))
    without = rig.model_copy(update={"trackers": {name: tracker.model_copy(update={"region": seed.Settings((9, 9))})}})
    text, _, rest = config.to_toml(without).partition(f"[trackers.{name}.region]")
    kept = text + chosen_region.toml(name, chosen) + "\n[" + rest.partition("\n[")[2]
    assert config.loads(kept, "rig.toml", Path("/")).trackers[name].region == chosen


def test_defaults_are_left_out():
    lines = '[trackers.sheet.region]\ntype = "seed"\npixel = [111, 133]\n'
    assert chosen_region.toml("sheet", seed.Settings(PIXEL)) == lines
    assert chosen_region.toml("sheet", replace(seed.Settings(PIXEL), grow="color")) == lines + 'grow = "color"\n'


def test_a_running_tracker_takes_a_pixel_of_its_image_only():
    simulation = simulate("simulated://sheet?seed=1")
    rig, plan = rig_of(simulation), default_plan()
    tracking = TrackingSession(rig, plan)
    list(drive(tracking, simulation, range(2)))
    camera = rig.sensors[plan.reference].camera
    assert tracking.mesh is not None
    place = camera.project(tracking.mesh.vertices.mean(axis=0, keepdims=True))[0]
    pixel = round(place[0]), round(place[1])
    assert chosen_region.reinitialize(tracking, rig, plan, "sheet", None) == ""
    list(drive(tracking, simulation, range(2, 4)))
    assert tracking.mesh_version == 2
    answer = chosen_region.reinitialize(tracking, rig, plan, "sheet", pixel)
    assert answer == chosen_region.toml("sheet", seed.Settings(pixel))
    steps = list(drive(tracking, simulation, range(4, 6)))
    assert (tracking.mesh_version, steps[-1].estimate.status) == (3, Status.TRACKING)
    with pytest.raises(RefusedError, match=f"outside the depth image of {camera.width} × {camera.height} pixels"):
        chosen_region.reinitialize(tracking, rig, plan, "sheet", (camera.width, 0))


def test_a_mask_that_is_gone_refuses_the_pixel(tmp_path):
    simulation = simulate("simulated://sheet?seed=1")
    rig = rig_of(simulation)
    gone = default_plan(region=nearest.Settings(within=tmp_path / "mask.png"))
    tracking = TrackingSession(rig, default_plan())
    with pytest.raises(RefusedError, match=r"mask\.png"):
        chosen_region.reinitialize(tracking, rig, gone, "sheet", (1, 1))
