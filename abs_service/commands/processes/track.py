"""Tracks one deformation: subscribes to the sensors' images, publishes the estimates, until SIGTERM or Ctrl-C.

  abs-service track rig.toml sheet                                  for the rig that `abs-service run` hosts elsewhere
  abs-service track rig.toml sheet --connect tcp/192.168.1.7:7447   of a rig on another host

Without CONFIG TRACKER it is the only tracker of the simulated demo rig.
"""

import argparse
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, wait
from contextlib import contextmanager, suppress
from functools import partial
from queue import SimpleQueue

from absmsg.v1.sensor_model_pb2 import SensorModel

from abs_service import config, wiring
from abs_service.bus import keys
from abs_service.bus.clock_offsets import ClockOffsets
from abs_service.bus.contract import Bus
from abs_service.bus.frames import FrameSubscriber
from abs_service.bus.health import Health, Level
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.bus.zenoh_session import pools
from abs_service.commands.parts import chosen_region, rig_process
from abs_service.pairing.common_clock import CommonClock
from abs_service.pairing.frame_set_queue import FrameSetQueue
from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.process_setup import process_tuning
from abs_service.tracking.live.estimate_publisher import EstimatePublisher
from abs_service.tracking.live.live_tracker import LiveTracker
from abs_service.tracking.live.tracker_health import TrackerHealth
from abs_service.tracking.monitors.calibration_monitor import CalibrationMonitor
from abs_service.tracking.observer import streams
from abs_service.tracking.plan import Plan
from abs_service.tracking.session import TrackingSession
from abs_service.tracking.warmup.board import is_undistorted, load_cached, warm_up
from abs_service.wire import commands
from abs_service.wire.checked_bus import CheckedBus
from calib.camera import Camera
from calib.jit import load_compiler
from calib.rig import Noise, Rig
from drivers.encoding.parsing import CodecError
from drivers.encoding.sensor_model import decode_camera

#: Timeout of a query for calibrations [s].
QUERY_S = 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service track`."""
    rig_process.add_arguments(parser)
    parser.add_argument("tracker", metavar="TRACKER", nargs="?", help="its name (default: the first one)")


def run(arguments: argparse.Namespace) -> int:
    """Tracks until SIGTERM or SIGINT."""
    settings = rig_process.load_config(arguments)
    name = arguments.tracker or next(iter(settings.trackers), "")
    plan, noises = wiring.plan(settings, name), wiring.noises(settings, name)
    if problem := wiring.reference_problem(settings, name, noises):
        raise wiring.PlanError(f"{config.named(arguments.config)}: {problem}")
    stop = rig_process.stop_on_signals()
    while not stop.is_set():
        with rig_process.open_bus(settings, arguments, "tracker") as bus, pools.watched(stop.set):
            track_until_recalibrated(bus, settings, name, plan, noises, stop)
    return Exit.OK


def track_until_recalibrated(
    bus: CheckedBus,
    settings: config.ServiceConfig,
    name: str,
    plan: Plan,
    noises: Mapping[str, Noise],
    stop: threading.Event,
) -> None:
    """Tracks until stopped, or until a sensor has another calibration."""
    headers = HeaderFactory(settings.name, WallClock())
    health = Health(bus, f"track/{name}", headers)
    bus.declare_liveliness(f"track/{name}")
    rigs: SimpleQueue[Rig] = SimpleQueue()
    preparing = _begin(partial(_prepare, rigs, noises, plan, health))
    cameras = await_cameras(bus, settings.trackers[name].sensors, health, stop)
    if stop.is_set():
        return
    monitor = CalibrationMonitor(cameras)
    bus.subscribe(keys.model("*"), lambda sample: monitor.take(SensorModel.FromString(sample.payload)))
    rigs.put(rig := wiring.rig(settings, name, cameras))
    _await(preparing, health, stop)
    if stop.is_set():
        return
    process_tuning.freeze_loaded_objects()
    session = TrackingSession(rig, plan)
    act = partial(chosen_region.reinitialize, session, rig, plan, name)
    commands.answer_reinitialize(bus, name, headers, health, act)
    with _measured_clocks(bus, headers) as clocks:
        sets = _frame_sets(bus, settings, name, rig, clocks)
        tracker_health = TrackerHealth(health, sets, time.monotonic_ns)
        publisher, budget_ms = _publisher(bus, settings, name, rig, headers), settings.trackers[name].budget_ms
        live = LiveTracker(session, sets, publisher, tracker_health, time.monotonic_ns, clocks, budget_ms)
        while not (stop.is_set() or monitor.changed.is_set()):
            live.process_next()
            if health.due():
                headers.clock.measure()
                _report(tracker_health, bus, health)
        tracker_health.report()
        health.publish()


def _begin(prepare: Callable[[], None]) -> Future[None]:
    """Prepares in a thread, which no end of the process waits for: an executor's would keep it while it compiles."""
    preparing: Future[None] = Future()

    def run() -> None:
        try:
            preparing.set_result(prepare())
        except BaseException as error:
            preparing.set_exception(error)

    threading.Thread(target=run, name="preparing", daemon=True).start()
    return preparing


def _await(preparing: Future[None], health: Health, stop: threading.Event) -> None:
    """Waits for the end of the preparation, or for `stop`; raises the error with which the preparation ended."""
    while not (preparing.done() or stop.is_set()):
        wait([preparing], 0.05)
        health.tick()
    health.publish()
    if preparing.done():
        preparing.result()


def _report(tracker_health: TrackerHealth, bus: CheckedBus, health: Health) -> None:
    tracker_health.report()
    bus.report(health)
    health.tick()


@contextmanager
def _measured_clocks(bus: Bus, headers: HeaderFactory) -> Iterator[ClockOffsets]:
    """Offsets of other hosts' clocks, which a thread measures meanwhile."""
    clocks, ended = ClockOffsets(bus, time.monotonic_ns, headers.host_clock), threading.Event()
    measuring = threading.Thread(target=clocks.measure_until, args=(ended,), name="clocks", daemon=True)
    measuring.start()
    try:
        yield clocks
    finally:
        ended.set()
        measuring.join()  # it uses the bus


def _frame_sets(bus: Bus, settings: config.ServiceConfig, name: str, rig: Rig, clocks: ClockOffsets) -> FrameSetQueue:
    frames = FrameSubscriber(bus, streams(rig.sensors.values()), time.monotonic_ns)
    synchroniser = wiring.synchroniser(settings, name, rig.sensors.values())
    common_clock = CommonClock(settings.reference(name), synchroniser.tolerance_ns, clocks.offset)
    return FrameSetQueue(frames, common_clock, synchroniser, time.monotonic_ns)


def _publisher(
    bus: Bus, settings: config.ServiceConfig, name: str, rig: Rig, headers: HeaderFactory
) -> EstimatePublisher:
    model_name, view_hz = wiring.model_name(settings, name), settings.trackers[name].view_hz
    return EstimatePublisher(bus, headers, name, model_name, rig.calib_id, view_hz)


def await_cameras(bus: Bus, sensors: tuple[str, ...], health: Health, stop: threading.Event) -> dict[str, Camera]:
    """Queries until every sensor's camera is known, or until stopped."""
    cameras: dict[str, Camera] = {}
    while not stop.is_set():
        for sensor in set(sensors) - set(cameras):
            for sample in bus.query(keys.model(sensor), QUERY_S):
                # Another answer may be right; until there is one, health says what is awaited.
                with suppress(CodecError):
                    cameras[sensor] = decode_camera(SensorModel.FromString(sample.payload))
        missing = [sensor for sensor in sensors if sensor not in cameras]
        if not missing:
            break
        health.report("calibration", Level.WARNING, f"waits for the calibration of {', '.join(missing)}")
        health.tick()
        stop.wait(0.03)
    health.report("calibration", Level.OK)
    return cameras


def _prepare(rigs: SimpleQueue[Rig], noises: Mapping[str, Noise], plan: Plan, health: Health) -> None:
    """Loads the compiler and likely kernels while the devices open, and then all that the rig needs."""
    load_compiler()
    loaded = load_cached(noises, plan)
    rig = rigs.get()
    if not (loaded and is_undistorted(rig)):
        health.label("phase", "preparing")
        warm_up(rig, plan, lambda progress: health.label("kernels", str(progress)))
        health.label("kernels", "")
    health.label("phase", "waiting")
