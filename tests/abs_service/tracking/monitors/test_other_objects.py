"""Detection after a loss: of the object wherever it is, however it is bent, and of no other thing."""

import dataclasses

import numpy as np
import pytest

from abs_service.tracker.detection.regions import nearest, seed
from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.optimizers import cma
from abs_service.tracking.monitors import loss_monitor
from abs_service.tracking.session import TrackingSession
from calib import pose
from drivers.simulated.scene.body import SurfaceBody
from drivers.simulated.scene.motion import Placement
from drivers.simulated.scene.texture import Texture
from drivers.simulated.shapes.rectangle import PlacedRectangle
from tests.abs_service.tracking.driving import default_plan, drive, rig_of, simulate

SIMULATION = simulate("simulated://sheet?seed=1&speed=0&color=160x120")
SHEET = SIMULATION.scene.surfaces[0].at(0)
assert isinstance(SHEET, PlacedRectangle)
GREY = Texture(np.full((2, 2, 4), 0.5, np.float32), 1.0)
PLAIN = dataclasses.replace(SHEET, texture=GREY)
NEAREST, QUICK = nearest.Settings(), cma.Settings(generations=2)
#: Exposure from which something else is in sight, and number of exposures.
SWAPPED, COUNT = 3, 16


@dataclasses.dataclass(frozen=True)
class Swapped:
    """The sheet, and later another thing in its place."""

    other: SurfaceBody
    sheet: SurfaceBody = SHEET

    def at(self, t: float) -> SurfaceBody:
        return self.sheet if t < (SWAPPED - 0.5) / SIMULATION.rate_hz else self.other


def thing(
    width: float, height: float, turn=(0.0, 0.0, 0.0), place=(0.1, 0.05, 1.1), curvature=0.0, texture=SHEET.texture
):
    placement = Placement(pose.from_rotation_vector(turn, place), curvature)
    return PlacedRectangle(width, height, texture, placement)


def swapped(other: SurfaceBody, region=NEAREST, keep_s=0.0, sheet=SHEET):
    """Steps of a session before whose cameras the sheet is exchanged, and the number of its meshes."""
    scene = dataclasses.replace(SIMULATION.scene, surfaces=(Swapped(other, sheet),))
    settings = loss_monitor.Settings(after_s=0.1, every_s=0.1, keep_s=keep_s, misfit_s=0.1)
    tracking = TrackingSession(
        rig_of(SIMULATION), default_plan(region=region, reinitialization=settings, optimizer=QUICK)
    )
    steps = list(drive(tracking, dataclasses.replace(SIMULATION, scene=scene), range(COUNT)))
    assert [step.estimate.status for step in steps[:SWAPPED]] == [Status.TRACKING] * SWAPPED
    return steps, tracking.mesh_version


@pytest.mark.parametrize("region", [seed.Settings(pixel=(88, 72)), NEAREST], ids=["seed", "nearest"])
def test_a_strip_of_the_same_area_is_not_the_lost_sheet(region):
    steps, meshes = swapped(thing(0.75, 0.08, place=(0.0, 0.0, 1.25)), region)
    assert Status.TRACKING not in {step.estimate.status for step in steps[SWAPPED:]}
    assert meshes == 1
    assert any("about its centre" in reason for step in steps for reason in step.estimate.reasons)


@pytest.mark.parametrize(
    ("scale", "keep_s"), [(0.7, 0.0), (1.4, 0.0), (1.4, 10.0)], ids=["half", "double", "kept mesh"]
)
def test_a_sheet_of_half_or_double_the_area_is_not_the_lost_one(scale, keep_s):
    steps, meshes = swapped(thing(0.3 * scale, 0.2 * scale), keep_s=keep_s)
    assert Status.TRACKING not in {step.estimate.status for step in steps[SWAPPED:]}
    assert meshes == 1
    assert any("what is in sight" in reason for step in steps for reason in step.estimate.reasons)


@pytest.mark.parametrize("keep_s", [0.0, 10.0], ids=["new mesh", "kept mesh"])
def test_a_thing_of_the_same_size_and_another_colour_is_not_the_lost_sheet(keep_s):
    steps, meshes = swapped(thing(0.3, 0.2, texture=GREY), keep_s=keep_s)
    assert Status.TRACKING not in {step.estimate.status for step in steps[SWAPPED:]}
    assert meshes == 1
    assert any("of its colours in color with the lost object" in r for step in steps for r in step.estimate.reasons)


def test_a_mesh_that_is_made_anew_where_it_does_not_fit_is_named():
    """Until a user knows, vertices are not the same material points any more without a word."""
    place = (0.0, 0.0, 1.0)
    larger = thing(0.36, 0.24, place=place, texture=GREY)
    steps, meshes = swapped(larger, sheet=thing(0.3, 0.2, place=place, texture=GREY))
    assert meshes == 2
    statuses = [step.estimate.status for step in steps]
    tracked = statuses.index(Status.TRACKING, SWAPPED)
    assert [step.estimate.reasons[-1] for step in steps[tracked - 2 : tracked]] == [
        "a new mesh was made 1 of 3 estimates ago",
        "a new mesh was made 2 of 3 estimates ago",
    ]


BACK = pytest.mark.parametrize(
    "back",
    [
        thing(0.3, 0.2, place=(0.12, 0.08, 1.1), turn=(0.0, 0.0, np.deg2rad(30))),
        thing(0.3, 0.2, turn=(0.3, 0.4, 0.0), curvature=np.deg2rad(100) / 0.3),
    ],
    ids=["moved", "bent"],
)


@BACK
def test_a_sheet_without_a_print_is_found_at_the_first_attempt(back):
    steps, meshes = swapped(dataclasses.replace(back, texture=GREY), sheet=PLAIN)
    statuses = [step.estimate.status for step in steps]
    assert meshes == 2
    lost = statuses.index(Status.LOST)
    assert statuses[-1] == Status.TRACKING
    assert statuses.index(Status.TRACKING, lost) <= lost + 6  # three frames LOST, two DEGRADED
    assert "found again, a new mesh was made 1 of 3 estimates ago" in steps[lost + 3].estimate.reasons


@BACK
def test_a_print_is_recognised_before_any_attempt_and_keeps_its_mesh(back):
    steps, meshes = swapped(back)
    statuses = [step.estimate.status for step in steps]
    assert meshes == 1
    lost = statuses.index(Status.LOST)
    assert any("keypoints of its print are seen elsewhere" in reason for reason in steps[lost].estimate.reasons)
    assert statuses[lost + 1 :] == [Status.DEGRADED] * 2 + [Status.TRACKING] * (COUNT - lost - 3)
