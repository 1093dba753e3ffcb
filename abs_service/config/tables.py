"""The tables of a configuration file, one model each."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, FiniteFloat

from abs_service.config.calibration import CalibrationOrigin, DepthTable
from abs_service.config.camera import CameraTable
from abs_service.config.table import Table
from abs_service.config.values import DeviceUri, Endpoint, Name, NoiseSettings, Plugin, RelativePath, SettingsOf, Stream

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class BusTable(Table):
    """`[bus]`: transport between the processes of a rig.

    Attributes:
        endpoint: zenoh endpoint that `run` listens on and everybody else connects to.
        shared_memory: whether images travel through shared memory on one host.
    """

    endpoint: Endpoint = "tcp/127.0.0.1:7447"
    shared_memory: bool = True


class DeviceTable(Table):
    """`[devices.<name>]`: one thing that delivers images.

    Attributes:
        uri: names its driver and which device.
        controls: what is set whenever it is opened; `abs-service devices URI` lists what there is.
    """

    uri: DeviceUri
    controls: dict[str, bool | int | float | str] = Field(default_factory=dict)


class SensorTable(Table):
    """`[sensors.<name>]`: one optical head of a device, by the name that it has on the wire.

    Attributes:
        device: name of the device that it belongs to.
        head: what the device calls it; "" if it is the sensor's name.
        camera: calibration in place of the device's own.
        noise: `Settings` of a module of `calib.noise` or `abs_service.tracker.measurements`; None if the sensor is
            recorded, but no tracker uses it.
        texture: likewise of what it sees of the surface besides: a time-of-flight camera's amplitudes, for example.
        outlier_share: share of its measurements that come from anywhere; None for the objective's own.
        range_m: distances that a depth sensor can report at all; None for the objective's own.
        no_return: `Settings` of `calib.no_return`, how often a depth sensor has no return from a surface.
        depth: systematic error of its distances.
        time_offset_ms: what has to be added to its exposures' times to get those of the others.
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
    time_offset_ms: FiniteFloat = 0.0


class SynchronisationTable(Table):
    """`[synchronisation]`: which images show one moment.

    Attributes:
        reference: stream whose exposures pace the trackers; "" if each tracker names its own.
        tolerance_ms: largest difference between its stamp and another stream's.
    """

    reference: Stream | Literal[""] = ""
    tolerance_ms: Positive = 12.0


class MeshTable(Table):
    """`mesh` of a tracker: the triangle mesh whose deformation is estimated; `vertices` is their number."""

    vertices: Annotated[int, Field(ge=4, le=100_000)] = 300


class TrackerTable(Table):
    """`[trackers.<name>]`: one estimate of a deformation from some of the sensors.

    Attributes:
        sensors: names of the sensors whose measurements count.
        reference: stream that paces this tracker; "" if it is that of `[synchronisation]`.
        model, region, synthesis, objective, optimizer: `Settings` of a module of `abs_service.tracker.models`, ….
        template: likewise of `abs_service.tracker.detection.templates`.
        mesh: the triangle mesh.
        priors, vertex_offsets: `Settings` of `tracker.posterior.priors.settings` and `tracking.offsets.vertex_offsets`.
        status, reinitialization: `Settings` of `abs_service.tracker.status` and `.loss`.
        budget_ms: time that the live search may take per frame set; replay does not look at the clock.
        budget_evaluations: how often a search may compute the cost of a candidate per frame set, live and in replay.
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
    status: Annotated[Any, SettingsOf("abs_service.tracker.status")] = Field(default={})
    reinitialization: Annotated[Any, SettingsOf("abs_service.tracking.monitors.loss_monitor")] = Field(default={})
    optimizer: Annotated[Any, Plugin("abs_service.tracker.optimizers")] = Field(default={"type": "hybrid"})
    budget_ms: Positive = 24.0
    budget_evaluations: Annotated[int, Field(ge=1)] = 100_000


class RecordTable(Table):
    """`[record]`: what is kept on disk.

    Attributes:
        enabled: whether `run` records.
        directory: folder of the recordings, created if it does not exist.
        compression: of MCAP chunks.
        chunk_bytes: size of a chunk before compression.
        flush_s: longest time until a message is on disk, and so the most that a crash can lose.
        rotate_bytes, rotate_s: size and age at which a new file begins.
        minimum_free_bytes: free space at which recording ends.
        queue_bytes: messages that may wait for a slow disk; more are dropped and counted.
    """

    enabled: bool = True
    directory: RelativePath = Path("recordings")
    compression: Literal["none", "lz4", "zstd"] = "lz4"
    chunk_bytes: Annotated[int, Field(ge=4096, le=1 << 30)] = 1 << 20
    flush_s: Positive = 1.0
    rotate_bytes: Annotated[int, Field(ge=1 << 16)] = 4_000_000_000
    rotate_s: Positive = 3600.0
    minimum_free_bytes: Annotated[int, Field(ge=0)] = 1_000_000_000
    queue_bytes: Annotated[int, Field(ge=1 << 20)] = 256 << 20


class RunTable(Table):
    """`[run]`: limits and timeouts of the supervisor.

    Attributes:
        max_restarts, restart_window_s: a process that needs more restarts than this within this time is given up.
        startup_timeout_s: timeout for the health of a process that starts or compiles its kernels.
        stall_timeout_s: timeout for its health afterwards; a process that exceeds it is restarted.
        stop_timeout_s: time that all processes together have to end in order before they are killed.
    """

    max_restarts: Annotated[int, Field(ge=0)] = 5
    restart_window_s: Positive = 60.0
    startup_timeout_s: Positive = 180.0
    stall_timeout_s: Positive = 10.0
    stop_timeout_s: Positive = 4.0


class ServiceConfig(Table):
    """A rig: name, devices, sensors, trackers, recorder.

    In a file, `calibration` may name a calibration file, whose content is put into the sensors' tables; here it is what
    is remembered of that file.
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
