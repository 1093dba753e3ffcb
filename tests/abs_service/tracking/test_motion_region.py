"""A session with a region that needs several images: it waits for them, also when it is asked to look again."""

from abs_service.tracker.detection.regions import seed
from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.optimizers import cma
from abs_service.tracking.session import TrackingSession
from tests.abs_service.tracking.driving import default_plan, drive, rig_of, simulate

SIMULATION = simulate("simulated://sheet?seed=1&speed=4")
MOTION = seed.Settings(motion_s=0.5, minimum_motion_m=0.01)
PLAN = default_plan(region=MOTION, optimizer=cma.Settings(generations=2))


def test_what_moves_is_tracked_and_found_again_on_request():
    tracking = TrackingSession(rig_of(SIMULATION), PLAN)
    begun = [step.estimate for step in drive(tracking, SIMULATION, range(60, 110))]
    waiting = [estimate for estimate in begun if estimate.status == Status.INITIALIZING]
    assert 15 <= len(waiting) < 50
    assert "in the images of 0.5 s, of which 0.00 s are there" in waiting[0].reasons[0]
    assert tracking.mesh_version == 1
    tracking.reinitialize()
    list(drive(tracking, SIMULATION, range(110, 120)))
    assert tracking.mesh_version == 1  # it still watches
    list(drive(tracking, SIMULATION, range(120, 170)))
    assert tracking.mesh_version == 2
