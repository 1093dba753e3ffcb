"""Health says which sensor's noise model is wrong, by how much and what to do; a right one is never accused."""

import dataclasses

import numpy as np
import pytest
from absmsg.v1.health_pb2 import Health as Message

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.tracker.objectives import euclidean
from abs_service.tracker.optimizers import cma
from abs_service.tracker.terms.sensor_fit import SensorFit
from abs_service.tracking.monitors.noise_monitor import MIN_INLIER_SHARE, MIN_RESIDUALS, WINDOW_NS, NoiseMonitor
from abs_service.tracking.session import TrackingSession
from tests.abs_service.bus.loopback import LoopbackBus
from tests.abs_service.tracking.driving import default_plan, drive, rig_of, simulate
from tests.abs_service.wire.test_estimate_messages import ESTIMATE

PERIOD_NS = 33_000_000
OK, WARNING = Message.LEVEL_OK, Message.LEVEL_WARNING


class MonitorBench:
    """A bench over a tracker."""

    def __init__(self):
        self.bus = LoopbackBus()
        self.health = Health(self.bus, "track/sheet", HeaderFactory("demo", WallClock(lambda: 0, lambda: 0)))
        self.monitor = NoiseMonitor(self.health)
        self.t_ns = 10**12

    def see(self, seconds=2.0, share=0.9, inliers=250, **variances):
        """Estimates for so long, whose residuals have these variances by sensor; tells what health says then."""
        return self.see_sensors(variances, seconds, share, inliers)

    def see_sensors(self, variances, seconds=2.0, share=0.9, inliers=250):
        """The same for sensors whose names are not Python's."""
        visible = round(inliers / share)
        fits = tuple(SensorFit(name, visible, 0, 300, inliers, 1.0, float(np.sqrt(v))) for name, v in variances.items())
        for _ in range(int(seconds * 1e9 / PERIOD_NS)):
            self.monitor.add(dataclasses.replace(ESTIMATE, t_host_ns=self.t_ns, fits=fits))
            self.t_ns += PERIOD_NS
        return self.said

    @property
    def said(self):
        self.health.publish()
        return Message.FromString(self.bus.sent[-1].payload)


def test_the_variance_of_every_sensor_is_a_gauge():
    said = MonitorBench().see(tof=1.1, color=0.7)
    assert said.gauges == {
        "residual_variance.tof": pytest.approx(1.1),
        "residual_variance.color": pytest.approx(0.7),
    }
    assert (said.level, said.message) == (OK, "")


@pytest.mark.parametrize(
    ("sensor", "variance", "factor", "change"),
    [("tof", 4.0, "2.0", "larger"), ("tof", 0.25, "0.5", "smaller"), ("color", 0.04, "0.2", "smaller")],
)
def test_a_wrong_model_is_named_with_its_factor_and_what_to_do(sensor, variance, factor, change):
    said = MonitorBench().see_sensors({"tof": 1.0, "color": 1.0, sensor: variance})
    assert said.level == WARNING
    assert said.message.startswith(f"{sensor} errs {factor} times as much as its noise model says")
    assert said.message.endswith(
        f"make the deviation in sensors.{sensor}.noise {change}, or fit it (docs/explanation/noise.md)"
    )


def test_the_texture_of_a_depth_sensor_has_a_key_of_its_own():
    message = MonitorBench().see_sensors({"tof": 1.0, "tof/amplitude": 9.0}).message
    assert message.startswith("tof/amplitude errs 3.0 times")
    assert "make the deviation in sensors.tof.texture larger" in message


def test_two_wrong_models_are_both_named():
    message = MonitorBench().see(tof=4.0, color=4.0).message
    assert "tof errs" in message
    assert "color errs" in message


def test_between_the_limits_the_warning_does_not_change():
    bench = MonitorBench()
    said = [bench.see(tof=variance).level for variance in (1.9, 2.2, 1.9, 1.6, 1.9, 0.45, 0.55, 0.65, 0.55)]
    assert said == [OK, WARNING, WARNING, OK, OK, WARNING, WARNING, OK, OK]


def test_a_few_frames_are_no_evidence():
    bench = MonitorBench()
    bench.see(tof=1.0)
    bench.see(0.1, tof=9.0)
    assert bench.see(1.0, tof=1.0).level == OK
    assert 1 < bench.said.gauges["residual_variance.tof"] < 2


def test_a_few_residuals_are_no_evidence():
    said = MonitorBench().see(inliers=MIN_RESIDUALS // 40, tof=9.0)
    assert said.level == OK
    assert not said.gauges


def test_estimates_with_few_inliers_are_ignored():
    bench = MonitorBench()
    assert bench.see(share=MIN_INLIER_SHARE - 0.05, tof=9.0).level == OK
    assert bench.see(share=MIN_INLIER_SHARE + 0.05, tof=9.0).level == WARNING


def test_time_that_goes_back_begins_a_new_window():
    bench = MonitorBench()
    bench.see(tof=1.0)
    bench.t_ns -= 100 * WINDOW_NS
    assert bench.see(tof=4.0).level == WARNING


def test_an_objective_without_noise_models_causes_no_warning():
    said = MonitorBench().see(tof=float("nan"))
    assert said.level == OK
    assert not said.gauges


def watched(uri, **changes):
    """Health after one window of the demo rig, whose noise model is that of noise=1."""
    simulation = simulate(uri)
    tracking = TrackingSession(rig_of(simulation), default_plan(optimizer=cma.Settings(generations=2), **changes))
    bench = MonitorBench()
    for step in drive(tracking, simulation, range(32)):
        bench.monitor.add(step.estimate)
    return bench.said


@pytest.mark.parametrize("seed", [1, 2])
def test_the_demo_rig_s_noise_models_are_right(seed):
    said = watched(f"simulated://sheet?seed={seed}")
    assert said.level == OK
    assert said.gauges["residual_variance.tof"] == pytest.approx(1, abs=0.15)
    assert said.gauges["residual_variance.color"] == pytest.approx(0.75, abs=0.15)


@pytest.mark.parametrize(("noise", "change"), [(2, "larger"), (0.5, "smaller")])
def test_sensors_with_another_noise_level_cause_a_warning(noise, change):
    said = watched(f"simulated://sheet?seed=1&noise={noise}")
    assert said.level == WARNING
    assert said.gauges["residual_variance.tof"] == pytest.approx(noise**2, rel=0.2)
    assert said.message.startswith("tof errs ")
    for sensor in ("tof", "color"):
        assert f"make the deviation in sensors.{sensor}.noise {change}" in said.message


def test_the_euclidean_objective_causes_no_warning_about_noise_models():
    said = watched("simulated://sheet?seed=1&noise=2", objective=euclidean.Settings())
    assert said.level == OK
    assert not said.gauges
