"""The region with a chosen pixel keeps what the rig file says of surfaces, and its lines of TOML make it again."""

from dataclasses import replace
from pathlib import Path

import pytest

from abs_service import config
from abs_service.commands.parts import chosen_region
from abs_service.tracker.detection.regions import above_plane, box, distance, mask, nearest, seed
from abs_service.tracker.estimates.estimate import Status
from abs_service.tracking.session import TrackingSession
from abs_service.wire.commands import AS_CONFIGURED, Choice, RefusedError
from abs_service.wire.commands import box as corners_of
from tests.abs_service.tracking.driving import default_plan, drive, rig_of, simulate

PIXEL = (111, 133)
POLYGON = ((80, 90), (160, 90), (120, 170))
MASK = Path("/rigs/mask.png")
NEAREST = nearest.Settings(maximum_step_m=0.02, minimum_pixels=100, within=MASK, polygon=POLYGON)


@pytest.mark.parametrize(
    ("region", "chosen"),
    [
        (nearest.Settings(maximum_step_m=0.02, within=MASK), seed.Settings(PIXEL, maximum_step_m=0.02, within=MASK)),
        (distance.Settings(1.2, maximum_step_m=0.03), seed.Settings(PIXEL, maximum_step_m=0.03)),
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
    assert kept(chosen) == chosen


def kept(chosen):
    """The region of a rig file with the lines that keep a choice."""
    rig = config.load_default()
    name, tracker = next(iter(rig.trackers.items()))
    without = rig.model_copy(update={"trackers": {name: tracker.model_copy(update={"region": seed.Settings((9, 9))})}})
    text, _, rest = config.to_toml(without).partition(f"[trackers.{name}.region]")
    lines = text + chosen_region.toml(name, chosen) + "\n[" + rest.partition("\n[")[2]
    return config.loads(lines, "rig.toml", Path("/")).trackers[name].region


@pytest.mark.parametrize(
    ("region", "chosen"),
    [
        (replace(NEAREST, polygon=None), NEAREST),
        (distance.Settings(1.2, maximum_step_m=0.03), nearest.Settings(maximum_step_m=0.03, polygon=POLYGON)),
        (above_plane.Settings(0.005, (1, 2)), above_plane.Settings(0.005, polygon=POLYGON)),
        (seed.Settings(motion_s=2.0, minimum_pixels=30), nearest.Settings(minimum_pixels=30, polygon=POLYGON)),
        (box.Settings((0, 0, 0), (1, 1, 1)), nearest.Settings(polygon=POLYGON)),
        (mask.Settings(MASK), nearest.Settings(polygon=POLYGON)),
    ],
)
def test_a_polygon_goes_into_the_region_and_back_into_the_rig_file(region, chosen):
    assert chosen_region.in_polygon(region, POLYGON) == chosen
    assert kept(chosen) == chosen


def test_a_pixel_takes_the_place_of_a_polygon():
    for region in (nearest.Settings(polygon=POLYGON), seed.Settings((1, 2), polygon=POLYGON)):
        assert chosen_region.at_pixel(region, PIXEL) == seed.Settings(PIXEL)
    assert chosen_region.at_pixel(above_plane.Settings(polygon=POLYGON), PIXEL) == above_plane.Settings(seed=PIXEL)


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
    assert chosen_region.reinitialize(tracking, rig, plan, "sheet", AS_CONFIGURED) == ""
    list(drive(tracking, simulation, range(2, 4)))
    assert tracking.mesh_version == 2
    answer = chosen_region.reinitialize(tracking, rig, plan, "sheet", Choice(seed=pixel))
    assert answer == chosen_region.toml("sheet", seed.Settings(pixel))
    steps = list(drive(tracking, simulation, range(4, 6)))
    assert (tracking.mesh_version, steps[-1].estimate.status) == (3, Status.TRACKING)
    with pytest.raises(RefusedError, match=f"outside the depth image of {camera.width} × {camera.height} pixels"):
        chosen_region.reinitialize(tracking, rig, plan, "sheet", Choice(seed=(camera.width, 0)))


def test_a_running_tracker_takes_the_object_in_a_polygon_until_the_next_command():
    """Of two sheets, the farther one is chosen by a box around it, and found there again."""
    simulation = simulate("simulated://pair?seed=1")
    rig, plan = rig_of(simulation), default_plan()
    tracking = TrackingSession(rig, plan)
    list(drive(tracking, simulation, range(2)))
    assert tracking.mesh is not None
    camera, first = rig.sensors[plan.reference].camera, tracking.mesh.vertices.mean(axis=0)
    half = camera.width // 2
    column = camera.project(first[None])[0, 0]
    other = (half, 0, camera.width - 1, camera.height - 1) if column < half else (0, 0, half, camera.height - 1)
    answer = chosen_region.reinitialize(tracking, rig, plan, "sheet", Choice(polygon=corners_of(*other)))
    assert answer == chosen_region.toml("sheet", nearest.Settings(polygon=corners_of(*other)))
    steps = list(drive(tracking, simulation, range(2, 4)))
    assert (tracking.mesh_version, steps[-1].estimate.status) == (2, Status.TRACKING)
    found = camera.project(tracking.mesh.vertices)[:, 0]
    assert found.min() > half - 2 if column < half else found.max() < half + 2
    outside = Choice(polygon=corners_of(0, 0, camera.width, 5))
    with pytest.raises(RefusedError, match="outside the depth image"):
        chosen_region.reinitialize(tracking, rig, plan, "sheet", outside)


def test_a_mask_that_is_gone_refuses_the_pixel(tmp_path):
    simulation = simulate("simulated://sheet?seed=1")
    rig = rig_of(simulation)
    gone = default_plan(region=nearest.Settings(within=tmp_path / "mask.png"))
    tracking = TrackingSession(rig, default_plan())
    with pytest.raises(RefusedError, match=r"mask\.png"):
        chosen_region.reinitialize(tracking, rig, gone, "sheet", Choice(seed=(1, 1)))
