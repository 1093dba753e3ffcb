"""Composition root: makes the parts of a tracker from the configuration."""

from collections.abc import Iterable, Mapping
from typing import Any

from abs_service.config import ServiceConfig, plugins
from abs_service.config.problems import Problem, allowed_instead
from abs_service.config.tables.service import TrackerTable
from abs_service.pairing.synchroniser import Synchroniser
from abs_service.tracker.detection.templates import first_image
from abs_service.tracker.detection.templates.base import BindsToMesh
from abs_service.tracker.measurements import measurement
from abs_service.tracker.models.base import HasOffsets
from abs_service.tracking.observer import streams
from abs_service.tracking.plan import Plan
from calib.camera import Camera
from calib.no_return import CAUTIOUS, NoReturn
from calib.noise.base import DepthNoise, ImageNoise, Mapped
from calib.rig import Noise, Rig, Sensor


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
    has_offsets = isinstance(table.model, HasOffsets)
    if table.vertex_offsets.random_walk and not has_offsets:
        raise PlanError(
            f"trackers.{tracker}.vertex_offsets.random_walk = {table.vertex_offsets.random_walk:g} "
            f'needs a model whose vertices have offsets, such as "nurbs", not "{model_name(config, tracker)}"; '
            "leave it out or set it to 0"
        )
    _check_template(tracker, table)
    return Plan(
        reference=reference,
        model=table.model,
        region=table.region,
        template=table.template,
        synthesis=table.synthesis,
        objective=table.objective,
        optimizer=table.optimizer,
        evaluations=table.budget_evaluations,
        vertices=table.mesh.vertices,
        priors=table.priors,
        status=table.status,
        reinitialization=table.reinitialization,
        vertex_offsets=table.vertex_offsets,
    )


def _check_template(tracker: str, table: TrackerTable) -> None:
    """PlanError if a tracker's template does not go with its other parts."""
    if isinstance(table.template, first_image.Settings):
        return
    kind = plugins.table(table.template)["type"]
    unbound = next((one for one in plugins.with_parts(table.model) if not isinstance(one, BindsToMesh)), None)
    if unbound is not None:
        raise PlanError(
            f'trackers.{tracker}.template.type = "{kind}": the model "{plugins.table(unbound)["type"]}" finds its '
            'object by itself and cannot be bound to a mesh; "rigid", "nurbs" and "flexpad" can, or leave template out'
        )
    if table.reinitialization.keep_s:
        raise PlanError(
            f"trackers.{tracker}.reinitialization.keep_s = {table.reinitialization.keep_s:g}: with a template, every "
            "detection has the same mesh; leave keep_s out or set it to 0"
        )


def model_name(config: ServiceConfig, tracker: str) -> str:
    """`type` of a tracker's deformation model."""
    return plugins.table(config.trackers[tracker].model)["type"]


def noises(config: ServiceConfig, tracker: str) -> dict[str, Noise]:
    """The noise model of everything that the sensors of one tracker measure.

    A texture is called by its sensor and stream: `tof/amplitude`.

    Raises:
        PlanError: a sensor has none, or one that does not fit its other keys.
        NoiseError: one cannot be made.
    """
    models: dict[str, Noise] = {}
    for name in config.trackers[tracker].sensors:
        table = config.sensors[name]
        if table.noise is None:
            raise PlanError(f'sensor "{name}" of tracker "{tracker}" has no noise model')
        models[name] = noise(table.noise, table.range_m, table.no_return)
        if table.texture is not None:
            made = texture(table.texture)
            models[f"{name}/{measurement(made).frames[0]}"] = made
    return models


def reference_problem(config: ServiceConfig, tracker: str, models: Mapping[str, Noise]) -> Problem | None:
    """The problem of a reference that is none of the images that a tracker uses: it would wait for it for ever.

    Args:
        config: the rig.
        tracker: name of the tracker.
        models: see `noises`.
    """
    used = {f"{name.partition('/')[0]}/{kind}" for name, model in models.items() for kind in measurement(model).frames}
    reference = "/".join(config.reference(tracker))
    if reference in used:
        return None
    key = ("trackers", tracker, "reference") if config.trackers[tracker].reference else ("synchronisation", "reference")
    return Problem(key, f'tracker "{tracker}" uses no such images, {allowed_instead(reference, used)}', reference)


def noise(settings: Any, range_m: float | None, no_return: NoReturn) -> Noise:
    """The noise model of one sensor, from the `Settings` of a module of `calib.noise`.

    Raises:
        PlanError: `range_m` or `no_return` is given for a sensor that measures no distances.
        NoiseError: the model cannot be made.
    """
    made = settings.build()
    if isinstance(made, DepthNoise):
        return made
    if range_m is not None:
        raise PlanError(f"range_m = {range_m:g} is for sensors that measure distances")
    if no_return != CAUTIOUS:
        raise PlanError(f"no_return = {plugins.plain(no_return)} is for sensors that measure distances")
    return made


def texture(settings: Any) -> ImageNoise:
    """Noise model of the texture channel of a depth sensor.

    Raises:
        PlanError: it is one of distances or of light barriers.
    """
    made = settings.build()
    if not isinstance(made, ImageNoise):
        kind = plugins.table(settings)["type"]
        raise PlanError(f'texture.type = "{kind}": must be intensity, color, grey or bayer')
    return made


def rig(config: ServiceConfig, tracker: str, cameras: Mapping[str, Camera]) -> Rig:
    """The sensors of one tracker with their cameras and noise models.

    Raises:
        PlanError: a sensor has no camera or no noise model, or the two are of different size.
        NoiseError: a noise model cannot be made.
    """
    sensors: dict[str, Sensor] = {}
    for name, model in noises(config, tracker).items():
        head = name.partition("/")[0]
        if head not in cameras:
            raise PlanError(f'sensor "{head}" of tracker "{tracker}" has no camera model')
        _check_size(head, model, cameras[head])
        table = config.sensors[head]
        depth = (table.depth.offset, table.depth.scale) if isinstance(model, DepthNoise) else ()
        sensors[name] = Sensor(
            name, cameras[head], model, table.outlier_share, table.range_m, *depth, no_return=table.no_return
        )
    return Rig(config.name, sensors)


def cameras(config: ServiceConfig, known: Mapping[str, Camera]) -> dict[str, Camera]:
    """The cameras of the sensors: those that are known from elsewhere, by sensor, overridden by the configuration."""
    tables = {name: table.camera for name, table in config.sensors.items()}
    own = {name: camera for name, table in tables.items() if (camera := table.own()) is not None}
    return own | {name: table.applied_to(known[name]) for name, table in tables.items() if name in known}


def synchroniser(config: ServiceConfig, tracker: str, sensors: Iterable[Sensor]) -> Synchroniser:
    """The synchroniser of one tracker."""
    return Synchroniser(
        config.reference(tracker),
        streams(sensors),
        round(config.synchronisation.tolerance_ms * 1e6),
        offsets_ns={name: round(table.time_offset_ms * 1e6) for name, table in config.sensors.items()},
    )


def _check_size(sensor: str, noise: Noise, camera: Camera) -> None:
    if isinstance(noise, Mapped) and noise.shape != (camera.height, camera.width):
        height, width = noise.shape
        raise PlanError(
            f"sensors.{sensor}.noise.file: its maps are for {width} × {height} pixels, "
            f"the camera has {camera.width} × {camera.height}"
        )
