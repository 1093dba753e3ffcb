"""Reinitialization of a lost object, and hysteresis until it counts as tracked again."""

import dataclasses

import numpy as np
import pytest

from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.estimates.estimate import Estimate, Status
from abs_service.tracker.estimates.status import Settings as Limits
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.terms.sensor_fit import RimFit, SensorFit
from abs_service.tracking.monitors.loss_monitor import LossMonitor, Settings
from abs_service.tracking.session import TrackingSession
from drivers.contract.frame import Frame, Kind
from tests.abs_service.tracker.scenes import flat, sheet
from tests.abs_service.tracking.driving import default_plan, drive, rig_of, simulate

FRAME_NS = 33_000_000
LIMITS = Limits(degraded_rim=0.3, degraded_rim_m=0.005)
SHEET = simulate("simulated://sheet?seed=1")
LOST = sheet(size=(0.3, 0.2))


def estimate(k: int, status: Status, reasons: tuple[str, ...] = ()) -> Estimate:
    return Estimate(k, k * FRAME_NS, {}, (), status, reasons)


def test_a_tracked_object_needs_no_attempt():
    monitor = LossMonitor(Settings(), LIMITS)
    assert [monitor.with_hysteresis(estimate(k, Status.TRACKING)).status for k in range(3)] == [Status.TRACKING] * 3
    assert not monitor.take_attempt(10**12)


def test_attempts_are_due_after_a_delay_and_then_periodically():
    monitor = LossMonitor(Settings(after_s=0.2, every_s=0.1), LIMITS)
    tries = []
    for k in range(1, 16):
        if monitor.take_attempt(k * FRAME_NS):
            tries.append(k)
        monitor.with_hysteresis(estimate(k, Status.LOST))
    assert tries == [8, 12]  # 0.2 s after frame 1, then every 0.1 s


def test_a_good_estimate_restarts_the_delay():
    monitor = LossMonitor(Settings(after_s=0.1), LIMITS)
    monitor.with_hysteresis(estimate(0, Status.LOST))
    monitor.with_hysteresis(estimate(1, Status.DEGRADED, ("no frame from color",)))
    monitor.with_hysteresis(estimate(9, Status.LOST))
    assert not monitor.take_attempt(10 * FRAME_NS)
    assert monitor.take_attempt(13 * FRAME_NS)


@pytest.mark.parametrize("rim", [RimFit(visible=60, outside=12, inside=12), RimFit(visible=60, inside=6, off_m=0.01)])
def test_a_mesh_that_stays_off_its_outline_is_made_anew(rim):
    monitor, tries = LossMonitor(Settings(misfit_s=0.2), LIMITS), []
    off = (SensorFit("tof", 300, 0, 300, 300, 0.0, 1.0, rim),)
    for k in range(1, 20):
        if monitor.take_attempt(k * FRAME_NS):
            tries.append(k)
        judged = estimate(k, Status.TRACKING) if k == 3 else dataclasses.replace(estimate(k, Status.DEGRADED), fits=off)
        monitor.with_hysteresis(judged)
    assert tries == [11, 18]  # 0.2 s after frame 4, and again as long after the next one


def test_a_jammed_mesh_that_lies_off_its_outline_in_some_frames_is_made_anew():
    monitor, tries = LossMonitor(Settings(misfit_s=0.2), LIMITS), []
    off = (SensorFit("tof", 300, 0, 300, 200, 0.0, 1.0, RimFit(visible=60, inside=30)),)
    for k in range(1, 14):
        if monitor.take_attempt(k * FRAME_NS):
            tries.append(k)
        monitor.with_hysteresis(dataclasses.replace(estimate(k, Status.DEGRADED), fits=() if k % 3 else off))
    assert tries == [10]  # 0.2 s after frame 3, beside a frame in which it is off


def test_after_a_loss_the_first_good_estimates_are_degraded():
    monitor = LossMonitor(Settings(confirm=3), LIMITS)
    monitor.with_hysteresis(estimate(0, Status.LOST))
    after = [monitor.with_hysteresis(estimate(k, Status.TRACKING)) for k in range(1, 5)]
    assert [e.status for e in after] == [Status.DEGRADED, Status.DEGRADED, Status.TRACKING, Status.TRACKING]
    assert after[1].reasons == ("found again 2 of 3 estimates ago",)
    assert after[2].reasons == ()


def test_an_estimate_in_doubt_after_a_loss_is_no_good_one():
    monitor = LossMonitor(Settings(confirm=3), LIMITS)
    judged = [Status.LOST, Status.DEGRADED, Status.DEGRADED, *[Status.TRACKING] * 3]
    after = [monitor.with_hysteresis(estimate(k, status)).status for k, status in enumerate(judged)]
    assert after == [Status.LOST, *[Status.DEGRADED] * 4, Status.TRACKING]


def test_a_mesh_that_caught_on_something_after_a_loss_is_looked_for_again():
    monitor, tries = LossMonitor(Settings(after_s=0.5, every_s=0.1, misfit_s=0.3), LIMITS), []
    judged = {0: Status.TRACKING, 3: Status.LOST, 20: Status.TRACKING, 21: Status.TRACKING, 22: Status.TRACKING}
    for k in range(40):
        if monitor.take_attempt(k * FRAME_NS):
            tries.append(k)
        monitor.with_hysteresis(estimate(k, judged.get(k, Status.DEGRADED)))
    assert tries == [11, 15, 19]  # 0.3 s after frame 1; after frame 22 it is found, and only in doubt


def test_after_a_long_doubt_single_good_estimates_are_chance():
    monitor = LossMonitor(Settings(confirm=3, misfit_s=0.3), LIMITS)
    good = {*range(5), 6, 20, 24, 25, 30, 31, 32, 33, 35}
    judged = [Status.TRACKING if k in good else Status.DEGRADED for k in range(36)]
    after = [monitor.with_hysteresis(estimate(k, status)) for k, status in enumerate(judged)]
    assert [k for k, one in enumerate(after) if one.status == Status.TRACKING] == [*range(5), 6, 32, 33, 35]
    assert after[25].reasons == ("agrees again in all checks 2 of 3 estimates ago",)


@pytest.mark.parametrize(
    "found",
    [
        sheet(size=(1.5, 1.0)),
        sheet(size=(0.1, 0.1)),
        sheet(size=(0.42, 0.28)),
        sheet(size=(0.21, 0.14)),
        sheet(size=(0.75, 0.08)),
    ],
    ids=["wall", "scrap", "double", "half", "strip"],
)
def test_objects_of_another_size_are_rejected(found: Mesh):
    with pytest.raises(DetectionError, match="what is in sight"):
        LossMonitor(Settings(), LIMITS).check_likeness(found, LOST)


@pytest.mark.parametrize("found", [sheet(size=(0.25, 0.2)), sheet(height=flat)], ids=["cut", "unbent"])
def test_the_same_object_is_accepted(found: Mesh):
    LossMonitor(Settings(), LIMITS).check_likeness(found, LOST)


def test_far_bits_of_a_room_with_the_area_of_the_object_are_rejected():
    halves = [sheet(rows=5, columns=9, size=(0.3, 0.1)) for _ in range(2)]
    apart = np.concatenate([halves[0].vertices, halves[1].vertices + np.array([1.0, 0.0, 0.5])])
    faces = np.concatenate([halves[0].faces, halves[1].faces + len(halves[0].vertices)])
    bits = dataclasses.replace(halves[0], vertices=apart, faces=faces)
    assert bits.area == pytest.approx(LOST.area, rel=0.1)
    with pytest.raises(DetectionError, match=r"spreads by 5\d cm about its centre \(root mean square\), not by 11 cm"):
        LossMonitor(Settings(), LIMITS).check_likeness(bits, LOST)


def test_what_has_other_colors_is_rejected_and_a_part_of_the_object_in_other_light_is_not():
    red, grey = np.full((len(LOST.vertices), 3), (180.0, 60.0, 40.0)), np.full((len(LOST.vertices), 3), 120.0)
    grey[::5] = red[::5]

    def seen(colors: np.ndarray) -> Mesh:
        return dataclasses.replace(LOST, appearance={"color": colors.astype(np.float32)})

    monitor = LossMonitor(Settings(), LIMITS)
    monitor.check_likeness(seen(grey / 2), seen(grey))
    monitor.check_likeness(seen(np.where(np.arange(len(red))[:, None] % 5, grey, np.nan)), seen(grey))
    with pytest.raises(
        DetectionError, match=r"what is in sight shares \d+% of its colours in color with the lost object"
    ):
        monitor.check_likeness(seen(red), seen(grey))


def without_object(k: int, frames: list[Frame]) -> list[Frame]:
    """Frames of a wall with a large opening from exposure 20 to 50, in grey light."""
    if not 20 <= k < 50:
        return frames
    return [dataclasses.replace(frame, data=_empty(frame)) for frame in frames]


def _empty(frame: Frame) -> np.ndarray:
    wall, opening = (round(z / 5 * 2**14) for z in (1.6, 3.2))
    data = np.full_like(frame.data, {Kind.DEPTH: wall, Kind.AMPLITUDE: 2000, Kind.COLOR: 90}[frame.kind])
    if frame.kind == Kind.DEPTH:
        data[:, : data.shape[1] * 11 // 20] = opening
    return data


def test_a_returning_object_is_reinitialized_with_a_new_mesh():
    plan = dataclasses.replace(default_plan(), reinitialization=Settings(after_s=0.3, every_s=0.1))
    tracking = TrackingSession(rig_of(SHEET), plan)
    # In between it has moved for three seconds, so that the last estimate is no good start.
    exposures = [*range(50), *range(140, 160)]
    steps = []
    for k, step in zip(exposures, drive(tracking, SHEET, exposures, without_object)):
        steps.append((k, step, tracking.mesh_version))
    status = {k: step.estimate.status for k, step, _ in steps}
    assert {status[k] for k in range(20)} == {Status.TRACKING}
    assert {status[k] for k in range(22, 50)} == {Status.LOST}
    assert any("cm², not" in reason for k, step, _ in steps if 35 <= k < 50 for reason in step.estimate.reasons)
    assert [version for k, _, version in steps if k == 49] == [1]
    assert {status[k] for k in range(150, 160)} == {Status.TRACKING}
    errors = [step.errors.vertex_mm for k, step, _ in steps if k >= 150 and step.errors is not None]
    assert len(errors) == 10
    assert max(errors) < 3


def test_reinitialize_makes_a_new_mesh_in_the_next_frame():
    tracking = TrackingSession(rig_of(SHEET), default_plan())
    versions = []
    for k, step in enumerate(drive(tracking, SHEET, range(6))):
        assert step.estimate.status == Status.TRACKING
        versions.append(tracking.mesh_version)
        if k == 2:
            tracking.reinitialize()
    assert versions == [1, 1, 1, 2, 2, 2]


def test_the_mesh_is_kept_for_keep_s_after_the_loss():
    monitor = LossMonitor(Settings(keep_s=1.0), LIMITS)
    assert not monitor.keeps_mesh(0)
    monitor.with_hysteresis(estimate(0, Status.LOST))
    assert monitor.keeps_mesh(FRAME_NS)
    assert not monitor.keeps_mesh(1_100_000_000)
    lost_for_good = LossMonitor(Settings(), LIMITS)
    lost_for_good.with_hysteresis(estimate(0, Status.LOST))
    assert not lost_for_good.keeps_mesh(FRAME_NS)
