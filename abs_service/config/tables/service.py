"""The tables of a configuration file, one model each."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from abs_service.config.tables.bus import BusTable
from abs_service.config.tables.calibration import CalibrationOrigin, DepthTable
from abs_service.config.tables.camera import CameraTable
from abs_service.config.tables.table import Table
from abs_service.config.tables.values import (
    MAX_DURATION_S,
    DeviceUri,
    Milliseconds,
    Name,
    NoiseSettings,
    OffsetMs,
    Plugin,
    RelativePath,
    Seconds,
    SettingsOf,
    Stream,
)

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Rate = Annotated[float, Field(ge=0, le=1000, allow_inf_nan=False)]


class DeviceTable(Table):
    """`[devices.<name>]`: one device that delivers images.

    Attributes:
        uri: its driver and which of the driver's devices it is; `abs-service devices` lists the attached ones.
        controls: values that are set whenever it is opened; `abs-service devices URI` lists its controls.
    """

    uri: DeviceUri
    controls: dict[str, bool | int | float | str] = Field(default_factory=dict)


class SensorTable(Table):
    """`[sensors.<name>]`: one optical head of a device, by the name that it has on the wire.

    Attributes:
        device: name of the device that it belongs to.
        head: name that the device has for it; "" if that is the sensor's name.
        camera: calibration in place of the device's own.
        noise: noise model of its measurements; a sensor without one is recorded, but no tracker can use it.
        texture: noise model of the second picture of a depth sensor, such as the amplitudes of a time-of-flight camera;
            without one, it is not compared.
        outlier_share: share of outliers among its measurements; without it, the objective's `outlier_share` counts.
        range_m: measuring range of a depth sensor [m]; without it, the objective's `range_m` counts.
        no_return: probability that a depth sensor has no return from a surface.
        depth: systematic error of its distances.
        view_hz: rate of the points that are published of a depth sensor for viewers [Hz]; 0 for none.
        time_offset_ms: offset that is added to the times of its exposures to agree with the other sensors' [ms].
    """

    device: str
    head: str = ""
    camera: CameraTable = CameraTable()
    noise: NoiseSettings | None = None
    texture: NoiseSettings | None = None
    outlier_share: Annotated[float, Field(gt=0, lt=1)] | None = None
    range_m: Positive | None = None
    no_return: Annotated[Any, SettingsOf("calib.no_return")] = Field(default={})
    depth: DepthTable = DepthTable()
    view_hz: Rate = 0.0
    time_offset_ms: OffsetMs = 0.0


class SynchronisationTable(Table):
    """`[synchronisation]`: which images show one moment.

    Attributes:
        reference: stream whose exposures pace the trackers; "" if each tracker names its own.
        tolerance_ms: largest difference between the time of its exposure and that of another stream's [ms].
    """

    reference: Stream | Literal[""] = ""
    tolerance_ms: Milliseconds = 12.0


class MeshTable(Table):
    """`[trackers.<name>.mesh]`: the triangle mesh whose deformation is estimated.

    Attributes:
        vertices: approximate number of its vertices. "auto": 300, fewer if the object has fewer pixels in the
            first image, down to 100; a template's mesh has 300.
    """

    vertices: Literal["auto"] | Annotated[int, Field(ge=4, le=100_000)] = "auto"


class TrackerTable(Table):
    """`[trackers.<name>]`: one estimate of a deformation from some of the sensors.

    Attributes:
        sensors: names of the sensors whose measurements count.
        reference: stream whose exposures pace this tracker; "" if it is that of `[synchronisation]`.
        model: deformation model, which defines the parameters Θ.
        region: part of the first depth image that is the object.
        template: prior knowledge of the object's shape.
        mesh: triangle mesh whose deformation is estimated.
        synthesis: computation of the measurements that a deformation predicts.
        objective: cost of a deformation, given the measurements.
        priors: knowledge of stretch and motion before any measurement.
        vertex_offsets: offsets of the vertices from the model's surface, learnt over frames.
        status: limits between TRACKING, DEGRADED and LOST.
        reinitialization: recovery of a lost object.
        optimizer: search for the deformation of least cost.
        budget_ms: time that the live search may take per frame set [ms]; replay does not look at the clock.
        budget_evaluations: number of candidates whose cost a search may compute per frame set, live and in replay.
        view_hz: rate of the meshes that are published for viewers, as triangles with colours [Hz]; 0 for none.
    """

    sensors: Annotated[tuple[str, ...], Field(min_length=1)]
    reference: Stream | Literal[""] = ""
    model: Annotated[Any, Plugin("abs_service.tracker.models")]
    region: Annotated[Any, Plugin("abs_service.tracker.detection.regions")] = Field(default={"type": "nearest"})
    template: Annotated[Any, Plugin("abs_service.tracker.detection.templates")] = Field(default={"type": "first_image"})
    mesh: MeshTable = MeshTable()
    synthesis: Annotated[Any, Plugin("abs_service.tracker.synthesis")] = Field(default={"type": "sparse"})
    objective: Annotated[Any, Plugin("abs_service.tracker.objectives")] = Field(default={"type": "likelihood"})
    priors: Annotated[Any, SettingsOf("abs_service.tracker.posterior.priors.settings")] = Field(default={})
    vertex_offsets: Annotated[Any, SettingsOf("abs_service.tracking.offsets.vertex_offsets")] = Field(default={})
    status: Annotated[Any, SettingsOf("abs_service.tracker.estimates.status")] = Field(default={})
    reinitialization: Annotated[Any, SettingsOf("abs_service.tracking.monitors.loss_monitor")] = Field(default={})
    optimizer: Annotated[Any, Plugin("abs_service.tracker.optimizers")] = Field(default={"type": "hybrid"})
    budget_ms: Milliseconds = 24.0
    budget_evaluations: Annotated[int, Field(ge=1)] = 100_000
    view_hz: Rate = 0.0


class RecordTable(Table):
    """`[record]`: recordings on disk.

    Attributes:
        enabled: `abs-service run` writes recordings.
        directory: folder of the recordings, created if it does not exist.
        begin: `start`: at once, and what is recorded before something is tracked is said to be; `tracking`: with
            the first TRACKING of any tracker, from whose next images on everything is kept.
        when: `always`; `requested`: from `abs-service trigger` on until `abs-service trigger --stop`; `not_tracking`:
            then, and when a tracker leaves TRACKING for DEGRADED or LOST. Each time with the last `pre_roll_s`.
        pre_roll_s: time before the trigger that is held in memory and recorded with it [s].
        pre_roll_bytes: size of the messages held in memory [bytes]; the oldest beyond it are dropped and counted.
        post_roll_s: time that is recorded after a tracker has left TRACKING for the last time [s].
        depth_codec: form of images with one channel, such as distances and amplitudes; viewers show `raw` ones only.
        color_codec: form of colour images and mosaics; viewers show `raw` and `jpeg`, which loses details
            and is for colour images alone: mosaics are `lossless` then.
        compression: compression of the chunks of the MCAP files, beyond that of the images.
        chunk_bytes: size of a chunk before compression [bytes].
        flush_s: longest time until a message is on disk, and so the most that a crash can lose [s].
        rotate_bytes: size of a file at which a new one begins [bytes].
        rotate_s: age of a file at which a new one begins [s].
        retain_s: age at which a recording is deleted [s]; without it, none is. Those beside which there is a file
            `*.keep` (`touch x.mcap.keep`) are never deleted.
        retain_bytes: size of all recordings together beyond which the oldest are deleted [bytes]; without it, none is.
        estimates: `x_estimates.mcap` is written beside each recording `x.mcap`, with the states, meshes, calibrations,
            configuration and health alone: without images it is small, and can be kept longer.
        retain_estimates_s, retain_estimates_bytes: the same for these files; without them, none is deleted.
        minimum_free_bytes: free space on the disk at which recording stops [bytes]; it resumes with half as much again.
        queue_bytes: size of the messages that may wait for a slow disk [bytes]; more are dropped and counted.
    """

    enabled: bool = True
    directory: RelativePath = Path("recordings")
    begin: Literal["start", "tracking"] = "start"
    when: Literal["always", "requested", "not_tracking"] = "always"
    pre_roll_s: Annotated[float, Field(ge=0, le=MAX_DURATION_S)] = 10.0
    pre_roll_bytes: Annotated[int, Field(ge=0)] = 1 << 30
    post_roll_s: Seconds = 10.0
    depth_codec: Literal["raw", "lossless"] = "raw"
    color_codec: Literal["raw", "lossless", "jpeg"] = "raw"
    compression: Literal["none", "lz4", "zstd"] = "lz4"
    chunk_bytes: Annotated[int, Field(ge=4096, le=1 << 30)] = 1 << 20
    flush_s: Seconds = 1.0
    rotate_bytes: Annotated[int, Field(ge=1 << 16)] = 4_000_000_000
    rotate_s: Seconds = 3600.0
    retain_s: Seconds | None = None
    retain_bytes: Annotated[int, Field(ge=1 << 16)] | None = None
    estimates: bool = False
    retain_estimates_s: Seconds | None = None
    retain_estimates_bytes: Annotated[int, Field(ge=1 << 16)] | None = None
    minimum_free_bytes: Annotated[int, Field(ge=0)] = 1_000_000_000
    queue_bytes: Annotated[int, Field(ge=1 << 20)] = 256 << 20


class RunTable(Table):
    """`[run]`: limits and timeouts of the supervisor, and its notifications.

    Attributes:
        max_restarts: number of restarts within `restart_window_s` that a process may need; with more, it is given up
            for as long. Without cameras or any tracker, `abs-service run` ends.
        restart_window_s: time over which the restarts of a process are counted [s].
        startup_timeout_s: longest time without health of a process that starts or compiles its kernels [s]; of one
            in which nothing runs meanwhile, `stall_timeout_s`.
        stall_timeout_s: longest time without health afterwards [s], which is sent once a second; a process that
            exceeds either is restarted. The time that it waited for a processor is added, up to `startup_timeout_s`.
        stop_timeout_s: time that all processes together have to end in order before they are killed [s].
        metrics_port: port of 127.0.0.1 at which Prometheus reads `/metrics`; 0: none. Needs the extra `metrics`.
    """

    max_restarts: Annotated[int, Field(ge=0)] = 5
    restart_window_s: Seconds = 60.0
    startup_timeout_s: Seconds = 180.0
    stall_timeout_s: Annotated[float, Field(ge=2, le=MAX_DURATION_S)] = 10.0
    stop_timeout_s: Seconds = 4.0
    metrics_port: Annotated[int, Field(ge=0, le=65535)] = 0


class ServiceConfig(Table):
    """A rig: name, devices, sensors, trackers, recorder.

    In a file, `calibration` may name a calibration file, whose content is put into the sensors' tables; here it is what
    is remembered of that file.

    Attributes:
        version: version of the file format.
        name: name of the rig on the wire: keys are `abs/NAME/…`.
        calibration: calibration file, whose keys of the sensors are put into their tables.
        bus: transport between the processes.
        devices: the devices by name.
        sensors: the optical heads of the devices by name.
        synchronisation: time tolerance between images of one moment.
        trackers: the trackers by name; without any, the rig only records.
        record: the recorder.
        run: limits and timeouts of the supervisor.
    """

    version: Literal[1]
    name: Name
    calibration: CalibrationOrigin | None = None
    bus: BusTable = BusTable()
    devices: dict[Name, DeviceTable]
    sensors: dict[Name, SensorTable]
    synchronisation: SynchronisationTable = SynchronisationTable()
    trackers: dict[Name, TrackerTable] = Field(default_factory=dict)
    record: RecordTable
    run: RunTable = RunTable()

    def heads(self, device: str) -> dict[str, str]:
        """Sensor names of a device by what the device calls its heads."""
        return {sensor.head or name: name for name, sensor in self.sensors.items() if sensor.device == device}

    def reference(self, tracker: str) -> tuple[str, str]:
        """Sensor and stream whose exposures pace a tracker."""
        sensor, stream = (self.trackers[tracker].reference or self.synchronisation.reference).split("/")
        return sensor, stream
