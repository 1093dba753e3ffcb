"""A camera that delivers its first image after the mesh was built."""

import dataclasses

from abs_service.tracker.estimates.estimate import Status
from abs_service.tracking.session import TrackingSession
from drivers.contract.frame import Frame, Kind
from tests.abs_service.tracking.driving import default_plan, drive, mean_errors, rig_of, simulate

SHEET = simulate("simulated://sheet?seed=1")
RIG = rig_of(SHEET)
WITHOUT_COLOR = {Kind.DEPTH, Kind.AMPLITUDE}


def test_a_color_camera_that_starts_late_is_not_ignored_for_ever():
    """Its first image shows what the vertices look like; until then only depth says where they are."""
    tracker = TrackingSession(RIG, default_plan())
    steps = list(drive(tracker, SHEET, range(27, 50), lambda k, f: without_color(f) if k < 30 else f))
    assert [step.estimate.status for step in steps] == [Status.DEGRADED] * 5 + [Status.TRACKING] * 18
    assert steps[3].estimate.reasons == ("a new mesh was made 1 of 3 estimates ago",)
    assert (tracker.mesh_version, tracker.made_ns) == (2, SHEET.time_ns(30))
    assert mean_errors(steps[3:])[0] < 2


def test_a_camera_that_starts_while_the_object_cannot_be_detected_waits_with_a_warning():
    """The object stays tracked by what was known of it; if it is lost, it is looked for again within a second."""

    def change(k: int, frames: list[Frame]) -> list[Frame]:
        if k < 30:
            return without_color(frames)
        return frames if k >= 40 else [halved(frame) if frame.kind == Kind.DEPTH else frame for frame in frames]

    tracker = TrackingSession(RIG, default_plan())
    steps = list(drive(tracker, SHEET, range(27, 60), change))
    (warning,) = steps[5].estimate.warnings
    assert warning.startswith("not used yet: color (")
    assert (tracker.mesh_version, tracker.made_ns >= SHEET.time_ns(40)) == (2, True)
    assert steps[-1].estimate.status == Status.TRACKING
    assert steps[-1].estimate.warnings == ()


def halved(frame: Frame) -> Frame:
    """The image with every column but those of a strip without return: too little to be the object."""
    data = frame.data.copy()
    data[:, : data.shape[1] // 2] = 0
    data[:, data.shape[1] // 2 + 8 :] = 0
    return dataclasses.replace(frame, data=data)


def without_color(frames: list[Frame]) -> list[Frame]:
    return [frame for frame in frames if frame.kind in WITHOUT_COLOR]
