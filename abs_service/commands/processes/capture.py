"""Publishes the images of a rig's devices, until SIGTERM or Ctrl-C or until all devices have ended (exit code 4).

  abs-service capture rig.toml                                 for the rig that `abs-service run` hosts elsewhere
  abs-service capture rig.toml --listen tcp/0.0.0.0:7447       alone; the others connect to this process

A device that fails is reopened, with exponential backoff.
"""

import argparse
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial

from abs_service import config
from abs_service.bus import clock_offsets, keys
from abs_service.bus.contract import Subscription
from abs_service.bus.frames import FramePublisher
from abs_service.bus.health import PUBLISHED, Health, Level
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.bus.zenoh_session import pools
from abs_service.capture import sensor_metadata
from abs_service.capture.device_supervisor import DeviceSupervisor
from abs_service.capture.metadata_publisher import MetadataPublisher
from abs_service.capture.point_clouds import PointCloudPublisher
from abs_service.capture.requested_controls import RequestedControls
from abs_service.commands.parts import rig_devices, rig_process
from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.process_setup import process_tuning
from abs_service.wire import control_commands
from abs_service.wire.checked_bus import CheckedBus
from drivers.contract.device import AddressError, Device, Sink
from drivers.opening import open_device

#: Time that the devices have to close [s].
CLOSE_S = 1.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service capture`."""
    rig_process.add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Captures until SIGTERM or SIGINT."""
    rig = rig_process.load_config(arguments)
    stop = rig_process.stop_on_signals()
    clock = WallClock()
    headers = HeaderFactory(rig.name, clock)
    with rig_process.open_bus(rig, arguments, "capture") as bus, pools.watched(stop.set):
        health = Health(bus, "capture", headers)
        bus.declare_liveliness("capture")
        bus.answer_queries(keys.SCHEMA, sensor_metadata.SCHEMA_MESSAGE, sensor_metadata.schema)
        if headers.host_clock:
            clock_offsets.answer(bus, headers)
        metadata = MetadataPublisher(bus, headers, rig_devices.configured_sensors(rig))
        publishers = {name: FramePublisher(bus, headers, name) for name in rig.devices}
        view_hz = {name: table.view_hz for name, table in rig.sensors.items()}
        points = {
            name: PointCloudPublisher(bus, clock, view_hz, metadata.camera, publisher)
            for name, publisher in publishers.items()
        }
        source = config.named(arguments.config)
        answer = partial(control_commands.answer_controls, bus, headers=headers, health=health)
        supervisors = [_supervisor(name, rig, source, metadata, points[name], health, answer) for name in rig.devices]
        for supervisor in supervisors:
            supervisor.start()
        configure = partial(follow, arguments.reconfigured, partial(_configure, metadata, arguments))
        _watch(stop, supervisors, configure, lambda: tick(bus, metadata, publishers, points, health, clock))
        _close(supervisors)
        for publisher in (*publishers.values(), *points.values()):
            publisher.close()
        _count(publishers, points, health)
        health.publish()
    errors = [supervisor.fatal_error for supervisor in supervisors if supervisor.fatal_error]
    if any(isinstance(error, AddressError) for error in errors):
        rig_devices.check_addresses(rig, source)  # those of the devices that were not opened any more, too
    if errors:
        raise errors[0]
    return Exit.ENDED if all(supervisor.finished for supervisor in supervisors) else Exit.OK


def _supervisor(
    name: str,
    rig: config.ServiceConfig,
    source: str,
    metadata: MetadataPublisher,
    sink: Sink,
    health: Health,
    answer: Callable[..., Subscription],
) -> DeviceSupervisor:
    requested = RequestedControls()

    def on_open(device: Device) -> None:
        rig_devices.set_controls(device, rig.devices[name].controls, f"{source}: devices.{name}.controls")
        requested.renew(device)
        metadata.add(rig_devices.cameras(rig, name, device))
        process_tuning.freeze_loaded_objects()

    supervisor = DeviceSupervisor(
        name,
        rig.devices[name].uri,
        lambda uri: open_device(uri, time.monotonic_ns),
        on_open,
        sink,
        rig.heads(name),
        health,
        time.monotonic_ns,
    )
    answer(name, act=lambda values: supervisor.use(partial(requested.set, values)))
    return supervisor


def follow(reconfigured: threading.Event, configure: Callable[[], None]) -> None:
    """Calls `configure` if the configuration has changed."""
    if reconfigured.is_set():
        reconfigured.clear()  # first: what changes while it is read will be read again
        configure()


def _configure(metadata: MetadataPublisher, arguments: argparse.Namespace) -> None:
    metadata.configure(rig_devices.configured_sensors(rig_process.load_config(arguments)))


def _watch(stop: threading.Event, supervisors: list[DeviceSupervisor], *ticks: Callable[[], None]) -> None:
    while not stop.wait(0.1):
        for tick in (*ticks, *(supervisor.check for supervisor in supervisors)):
            tick()
        if any(supervisor.fatal_error for supervisor in supervisors) or all(
            supervisor.finished for supervisor in supervisors
        ):
            return


def _close(supervisors: list[DeviceSupervisor]) -> None:
    """Closes all devices at the same time: a camera may take most of it."""
    for supervisor in supervisors:
        supervisor.stop()
    deadline_s = time.monotonic() + CLOSE_S
    for supervisor in supervisors:
        supervisor.close(max(0.0, deadline_s - time.monotonic()))


def tick(
    bus: CheckedBus,
    metadata: MetadataPublisher,
    publishers: Mapping[str, FramePublisher],
    points: Mapping[str, PointCloudPublisher],
    health: Health,
    clock: WallClock,
) -> None:
    """Follows the wall clock, and publishes new metadata and the health, once a second."""
    if not health.due():
        return
    steps = clock.steps
    change_ns = clock.measure()
    if clock.steps > steps:
        health.count("clock_steps")
        health.report("clock", Level.WARNING, f"the wall clock was set by {change_ns / 1e9:+.3f} s; stamps follow it")
    else:
        health.report("clock", Level.OK)
    _count(publishers, points, health)
    metadata.publish()
    bus.report(health)
    health.tick()


def _count(publishers: Mapping[str, FramePublisher], points: Mapping[str, PointCloudPublisher], health: Health) -> None:
    for clouds in points.values():
        health.count_up_to(clouds.dropped, "dropped.")
    for name, publisher in publishers.items():
        trouble = publisher.take_trouble()
        health.report(f"frames of {name}", Level.ERROR if trouble else Level.OK, trouble)
        health.count_up_to(publisher.dropped, "dropped.")
        health.count_up_to(publisher.published, PUBLISHED)
        for topic, number in publisher.published.items():
            health.rate(f"rate_hz.{topic}", number)
