"""Every deformation model finds its object again after it was out of sight for a second."""

import pytest

from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.models import flexpad, nurbs, posed, rigid
from abs_service.tracking.session import TrackingSession
from tests.abs_service.tracking.driving import default_plan, drive, mean_errors, rig_of, simulate


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "model", "error_mm"),
    [
        ("sheet", nurbs.Settings((4, 4), 2), 2),
        ("sheet", posed.Settings(nurbs.Settings((4, 4), 2)), 2),
        ("sheet", flexpad.Settings(0.3, 0.2), 2),
        ("board", rigid.Settings(), 6),  # a board of one-coloured squares slides along itself
    ],
    ids=["nurbs", "posed", "flexpad", "rigid"],
)
def test_what_left_and_came_back_is_tracked_anew(scene, model, error_mm):
    simulation = simulate(f"simulated://{scene}?seed=2&leave=2,3")
    tracking = TrackingSession(rig_of(simulation), default_plan(model=model))
    steps = list(drive(tracking, simulation, range(45, 185)))
    away, after = steps[25:40], steps[-40:]
    assert {step.estimate.status for step in away} == {Status.LOST}
    assert {step.estimate.status for step in after} == {Status.TRACKING}
    print(f"{scene}: vertex error {mean_errors(after)[0]:.2f} mm")
    assert mean_errors(after)[0] < error_mm  # of a new mesh, or of the old one if its print is recognised
