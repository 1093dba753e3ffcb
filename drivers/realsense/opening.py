"""Discovers and opens attached cameras and recordings played by librealsense."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from drivers.contract.address import with_name
from drivers.contract.device import AddressError, DeviceError, DeviceInfo, SdkMissingError
from drivers.contract.discovery import UDEV_REMEDY, Availability, Found, choose
from drivers.realsense import library
from drivers.realsense.address import Address, parse
from drivers.realsense.device import RealsenseDevice, UsedSensor
from drivers.realsense.profiles import of_sensor, wanted


def discover(timeout_s: float) -> list[Found]:
    """Attached cameras; never raises."""
    try:
        rs = library.load()
    except SdkMissingError as error:
        return [
            Found(DeviceInfo("realsense://", "RealSense", ""), Availability.SDK_MISSING, error.reason, error.remedy)
        ]
    try:
        return [_found(rs, camera) for camera in rs.context().query_devices()]
    except RuntimeError as error:
        return [Found(DeviceInfo("realsense://", "RealSense", ""), Availability.FAULTY, f"librealsense says: {error}")]


def open_device(uri: str, clock: Callable[[], int]) -> RealsenseDevice:
    """Opens `realsense://SERIAL`, or `realsense://?recording=FILE.db3`, played by librealsense.

    Raises:
        AddressError: invalid address, or the file cannot be played.
        SdkMissingError: pyrealsense2 is not installed.
        DeviceError: no such camera, or it lacks a requested stream.
    """
    address = parse(uri)
    rs = library.load()
    if address.recording is not None:
        return _play(rs, address, str(address.recording), clock)
    serial = choose(discover(1.0), "realsense", address.serial).info.serial
    with library.translated_errors(uri):
        there = (one for one in rs.context().query_devices() if _text(rs, one, "serial_number") == serial)
        if (camera := next(there, None)) is None:
            raise DeviceError(f"{uri}: {serial} was unplugged while it was opened")
        for sensor in camera.query_sensors():
            # Otherwise librealsense maps timestamps to host time itself, by an unobservable fit.
            if sensor.supports(rs.option.global_time_enabled):
                sensor.set_option(rs.option.global_time_enabled, 0.0)
        offers = [(sensor, of_sensor(sensor)) for sensor in camera.query_sensors()]
        chosen = set(map(id, wanted([stream for _, streams in offers for stream in streams], address)))
        info = replace(device_info(rs, camera), uri=with_name(uri, serial))
    used = [UsedSensor(sensor, [stream for stream in streams if id(stream) in chosen]) for sensor, streams in offers]
    return _device(rs, camera, info, used, clock)


def of_device(rs: Any, camera: Any, info: DeviceInfo, clock: Callable[[], int]) -> RealsenseDevice:
    """Device of an `rs.device` with all its streams: a software device or a playback.

    Raises:
        DeviceError: no supported stream.
    """
    with library.translated_errors(info.uri):
        used = [UsedSensor(sensor, of_sensor(sensor)) for sensor in camera.query_sensors()]
    return _device(rs, camera, info, used, clock)


def device_info(rs: Any, camera: Any) -> DeviceInfo:
    """Identity of a camera."""
    serial = _text(rs, camera, "serial_number")
    usb = _text(rs, camera, "usb_type_descriptor")
    link = f"USB {usb}" if usb else ""
    return DeviceInfo(
        f"realsense://{serial}", _text(rs, camera, "name"), serial, _text(rs, camera, "firmware_version"), link
    )


def _play(rs: Any, address: Address, path: str, clock: Callable[[], int]) -> RealsenseDevice:
    try:
        playback = rs.playback(rs.context().load_device(path))
    except RuntimeError as error:
        raise AddressError(f"{address.uri}: {path} cannot be played: {error}") from error
    info = DeviceInfo(address.uri, _text(rs, playback, "name"), _text(rs, playback, "serial_number"))
    device = of_device(rs, playback, info, clock)

    def changed(status: Any) -> None:
        if status == rs.playback_status.stopped:
            device.end("the recording has ended")

    playback.set_status_changed_callback(changed)
    return device


def _device(
    rs: Any, camera: Any, info: DeviceInfo, used: list[UsedSensor], clock: Callable[[], int]
) -> RealsenseDevice:
    with_streams = [one for one in used if one.streams]
    if not with_streams:
        raise DeviceError(f"{info.uri}: it has no stream of depth, infra-red, confidence or colour")
    return RealsenseDevice(rs, camera, info, with_streams, clock)


def _found(rs: Any, camera: Any) -> Found:
    try:
        info = device_info(rs, camera)
        camera.query_sensors()
    except RuntimeError as error:
        who = DeviceInfo("realsense://", "RealSense", "")
        return Found(who, Availability.NO_PERMISSION, f"it cannot be read: {error}", UDEV_REMEDY)
    return Found(info)


def _text(rs: Any, camera: Any, key: str) -> str:
    info = getattr(rs.camera_info, key)
    return camera.get_info(info) if camera.supports(info) else ""
