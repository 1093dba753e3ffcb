"""A mesh that began partly hidden grows when what hid the object leaves."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.tracker.detection.regions import box
from abs_service.tracker.estimates.estimate import Status
from abs_service.tracking.monitors import loss_monitor
from abs_service.tracking.session import TrackingSession
from drivers.contract.frame import Frame, Kind
from tests.abs_service.tracking.driving import default_plan, drive, rig_of, simulate

#: Around the sheet, behind what hides it [m].
REGION = box.Settings((-0.4, -0.4, 0.8), (0.4, 0.4, 1.3))
#: Where an occluder is, how long, and after what time the mesh grows [frames].
OCCLUDER_M, LEAVES, GROWS = 0.55, 10, 12


def hiding(columns: slice, rows: slice, until: int):
    """Change of frames: until an exposure, something is in front of a part of the depth image, in shares of it."""

    def part(data: np.ndarray) -> tuple[slice, slice]:
        shares = ((rows, data.shape[0]), (columns, data.shape[1]))
        first, second = (slice(*(round(end * size / 100) for end in (at.start, at.stop))) for at, size in shares)
        return first, second

    def change(k: int, frames: list[Frame]) -> list[Frame]:
        return [covered(frame) if k < until and frame.kind in (Kind.DEPTH, Kind.COLOR) else frame for frame in frames]

    def covered(frame: Frame) -> Frame:
        data = frame.data.copy()
        data[part(data)] = round(OCCLUDER_M / frame.scale) if frame.kind == Kind.DEPTH else 40
        return replace(frame, data=data)

    return change


def session(simulation, grow_s: float) -> TrackingSession:
    settings = loss_monitor.Settings(grow_s=grow_s)
    return TrackingSession(rig_of(simulation), default_plan(region=REGION, reinitialization=settings))


def area(tracking: TrackingSession) -> float:
    """Area of a session's mesh [m²], which there is."""
    assert tracking.mesh is not None
    return tracking.mesh.area


@pytest.mark.parametrize(
    ("columns", "rows"), [(slice(48, 100), slice(0, 100)), (slice(51, 100), slice(35, 100))], ids=["half", "corner"]
)
def test_the_mesh_grows_when_what_hid_the_object_leaves(columns: slice, rows: slice):
    simulation = simulate("simulated://sheet?seed=3")
    whole = session(simulation, grow_s=0.4)
    next(drive(whole, simulation, range(1)))
    tracking = session(simulation, grow_s=0.4)
    change = hiding(columns, rows, until=LEAVES)
    areas, steps = [], []
    for step in drive(tracking, simulation, range(LEAVES + GROWS + 8), change):
        steps.append(step)
        areas.append(area(tracking) / area(whole))
    before, grown = LEAVES + GROWS, LEAVES + GROWS + 1
    assert areas[before] == areas[0] < 0.7
    assert areas[grown] == areas[-1] == pytest.approx(1.0, abs=0.1)
    assert tracking.mesh_version == 2
    assert all(step.estimate.status == Status.TRACKING for step in steps[:grown])
    assert steps[grown].estimate.status == Status.DEGRADED
    assert steps[grown].estimate.reasons == ("a larger mesh was made 1 of 3 estimates ago",)
    assert steps[-1].estimate.status == Status.TRACKING
    assert steps[-1].errors.surface_mm < 2


def test_a_mesh_that_something_covers_later_stays():
    """A cover from the fifth frame on has no part in the mesh, and uncovers nothing when it leaves."""
    simulation = simulate("simulated://sheet?seed=3")
    tracking = session(simulation, grow_s=0.1)
    change = hiding(slice(60, 100), slice(0, 100), until=LEAVES)
    later = [
        step.estimate
        for step in drive(tracking, simulation, range(20), lambda k, frames: change(k if k > 4 else LEAVES, frames))
    ]
    assert tracking.mesh_version == 1
    assert later[-1].status == Status.TRACKING
