"""From the configuration to what a tracker is made of."""

from collections.abc import Mapping
from typing import Any

from abs_service import plugins
from abs_service.config import ServiceConfig
from abs_service.tracking import Plan
from calib.camera import Camera
from calib.noise.base import DepthNoise
from calib.noise.color import GaussianColor
from calib.noise.pixel_polynomial import PixelPolynomial
from calib.noise.region_polynomial import RegionPolynomial
from calib.rig import Rig, Sensor


class PlanError(Exception):
    """A tracker that cannot be made from this configuration and these sensors."""


def plan(config: ServiceConfig, tracker: str) -> Plan:
    """The plan of one tracker.

    Raises:
        PlanError: the configuration has no such tracker, or its reference is none of its sensors.
    """
    if tracker not in config.trackers:
        raise PlanError(
            f'there is no tracker "{tracker}"; the configuration has: {", ".join(config.trackers) or "none"}'
        )
    table = config.trackers[tracker]
    reference = config.reference(tracker)[0]
    if reference not in table.sensors:
        raise PlanError(
            f"trackers.{tracker}.sensors = {list(table.sensors)} must contain "
            f'the sensor of the tracker\'s reference, "{reference}"'
        )
    return Plan(
        reference=reference,
        model=table.model,
        region=table.region,
        synthesis=table.synthesis,
        objective=table.objective,
        optimizer=table.optimizer,
        vertices=table.mesh.vertices,
        priors=table.priors,
        status=table.status,
        reinitialization=table.reinitialization,
    )


def model_name(config: ServiceConfig, tracker: str) -> str:
    """`type` of a tracker's deformation model."""
    return plugins.table(config.trackers[tracker].model)["type"]


def noises(config: ServiceConfig, tracker: str) -> dict[str, DepthNoise | GaussianColor]:
    """The noise model of every sensor of one tracker.

    Raises:
        PlanError: a sensor has none, or one that does not fit its other keys.
        NoiseError: one cannot be made.
    """
    models: dict[str, DepthNoise | GaussianColor] = {}
    for name in config.trackers[tracker].sensors:
        settings = config.sensors[name].noise
        if settings is None:
            raise PlanError(f'sensor "{name}" of tracker "{tracker}" has no noise model')
        models[name] = noise(settings, config.sensors[name].range_m)
    return models


def noise(settings: Any, range_m: float | None) -> DepthNoise | GaussianColor:
    """The noise model of one sensor, from the `Settings` of a module of `calib.noise`.

    Raises:
        PlanError: the sensor is said to have a range of distances, but measures none.
        NoiseError: the model cannot be made.
    """
    made = settings.build()
    if range_m is not None and not isinstance(made, DepthNoise):
        raise PlanError(f"range_m = {range_m:g} is for sensors that measure distances")
    return made


def rig(config: ServiceConfig, tracker: str, cameras: Mapping[str, Camera]) -> Rig:
    """The sensors of one tracker with their cameras and noise models.

    Raises:
        PlanError: a sensor has no camera or no noise model, or the two are of different size.
        NoiseError: a noise model cannot be made.
    """
    sensors: dict[str, Sensor] = {}
    for name, model in noises(config, tracker).items():
        if name not in cameras:
            raise PlanError(f'sensor "{name}" of tracker "{tracker}" has no camera model')
        _check_size(name, model, cameras[name])
        table = config.sensors[name]
        sensors[name] = Sensor(name, cameras[name], model, table.outlier_share, table.range_m)
    return Rig(config.name, sensors)


def _check_size(sensor: str, noise: DepthNoise | GaussianColor, camera: Camera) -> None:
    if isinstance(noise, (PixelPolynomial, RegionPolynomial)) and noise.shape != (camera.height, camera.width):
        height, width = noise.shape
        raise PlanError(
            f"sensors.{sensor}.noise.file: its maps are for {width} × {height} pixels, "
            f"the camera has {camera.width} × {camera.height}"
        )
