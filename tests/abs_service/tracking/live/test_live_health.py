"""The health of a live tracker: frames that are missing or of no use, doubts about object, noise and scale."""

import dataclasses

import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health as Message

from abs_service.tracker.detection.regions import box
from tests.abs_service.tracking.live.live_tracker_bench import Bench

SECOND = 1_000_000_000


@pytest.fixture
def bench():
    return Bench()


def test_a_tracker_without_frames_is_an_error_until_they_come(bench):
    bench.expose(0)
    bench.live.process_next()
    bench.now_ns += SECOND
    assert bench.said.level == Message.LEVEL_OK, "the first may take long"
    for _ in range(10):
        bench.now_ns += SECOND
        bench.tracker_health.report()
    said = bench.said
    assert said.level == Message.LEVEL_ERROR
    assert said.message == "no estimate for 11 s: no frames come from the cameras"
    bench.expose(1)
    bench.live.process_next()
    assert bench.said.level == Message.LEVEL_OK


def test_a_tracker_whose_frames_are_all_of_no_use_says_why(bench):
    for k in range(50):
        bench.expose(k, lambda frame: dataclasses.replace(frame, seq=min(frame.seq, 2)))
        bench.live.process_next()
    said = bench.said
    assert said.level == Message.LEVEL_ERROR
    assert said.message.startswith("no estimate for 2 s: since then unused.")
    assert ".duplicate 47" in said.message


def test_frames_that_do_not_fit_the_rig_are_an_error_that_passes(bench):
    bench.expose(0, lambda frame: dataclasses.replace(frame, data=frame.data[:100]))
    bench.live.process_next()
    said = bench.said
    assert said.level == Message.LEVEL_ERROR
    assert "pixels, but the camera model of sensors." in said.message
    assert said.counters["rejected"] == 1
    assert bench.states == []
    # In a new epoch the sensor may have another size.
    bench.expose(1, lambda frame: dataclasses.replace(frame, epoch=1))
    bench.live.process_next()
    assert len(bench.states) == 1
    assert bench.said.level == Message.LEVEL_OK


def test_what_the_residuals_say_of_the_noise_models_is_in_health(bench):
    for k in (0, 31):
        bench.expose(k)
        bench.live.process_next()
    assert bench.said.gauges["residual_variance.tof"] == pytest.approx(1, abs=0.5)


def test_doubts_about_the_object_are_in_every_state_and_in_health():
    bench = Bench(region=box.Settings((-9.0, -9.0, 0.0), (9.0, 9.0, 9.0)))
    for k in (3, 4):  # from some exposures, no model of wall and sheet together can be made
        bench.expose(k)
        bench.live.process_next()
    first, second = bench.states
    region, left_out = first.warnings
    assert "is the region right?" in region
    assert "lie beside the mesh" in left_out  # it does not go from the wall to the sheet
    assert list(second.warnings) == [region, left_out]
    said = bench.said
    assert said.level == Message.LEVEL_WARNING
    assert region in said.message
    assert left_out in said.message


def test_a_wrong_depth_scale_is_a_warning_until_it_is_right(bench):
    bench.expose(0, lambda frame: dataclasses.replace(frame, scale=frame.scale * 1e-3))
    bench.live.process_next()
    (state,) = bench.states
    assert state.status == DeformationState.STATUS_INITIALIZING
    assert "is the depth scale right?" in state.warnings[0]
    said = bench.said
    assert said.level == Message.LEVEL_WARNING
    assert state.warnings[0] in said.message
    bench.expose(1, lambda frame: dataclasses.replace(frame, epoch=1))
    bench.live.process_next()
    assert list(bench.states[1].warnings) == []
    assert bench.said.level == Message.LEVEL_OK
