"""Tables of a calibration file, and its provenance in a merged configuration."""

from typing import Annotated, Any, Literal

from pydantic import Field, FiniteFloat

from abs_service.config.tables.camera import CameraTable
from abs_service.config.tables.table import Table
from abs_service.config.tables.values import Name, NoiseSettings, OffsetMs, SettingsOf

#: Keys of a sensor in a calibration file that are keys of the same sensor in a rig file.
SHARED = ("camera", "noise", "texture", "outlier_share", "range_m", "no_return", "depth", "time_offset_ms")


class DepthTable(Table):
    """`depth`: systematic error of a depth sensor, which is subtracted from every distance first.

    measured = (1 + scale) · distance + offset, for radial distances.

    Attributes:
        offset: constant error of a distance [m].
        scale: error of a distance relative to it.
    """

    offset: FiniteFloat = 0.0
    scale: Annotated[FiniteFloat, Field(gt=-1)] = 0.0


class DataTable(Table):
    """A file or folder that a calibration was computed from, and its SHA-256."""

    name: str
    sha256: str


class ProvenanceTable(Table):
    """`[provenance]`: the command that computed a calibration, when, its version, from what, and its own verdict."""

    command: str
    date: str
    version: str
    verdict: Literal["good", "doubtful", "bad", "unknown"] = "unknown"
    data: tuple[DataTable, ...] = ()


class CovarianceTable(Table):
    """`[covariance]`: the file beside this one with the covariances of all parameters, and its SHA-256."""

    file: str
    sha256: str


class ResidualsTable(Table):
    """`residuals`: root mean squares of the residuals, and their number of views.

    Attributes:
        corners_px: of corners [px].
        distances: of distances on boards [m].
        views: number of images that showed the board.
        poses: number of distinct poses of the board in them.
    """

    corners_px: FiniteFloat | None = None
    distances: FiniteFloat | None = None
    views: int | None = None
    poses: int | None = None


class SensorEvidence(Table):
    """Supplementary data of a sensor in a calibration file, for people and other commands, not for the tracker.

    Attributes:
        factory: the device's own calibration, which the file's takes the place of.
        sigma: standard deviation of every determined parameter; names as in `calib.solve.bundle.parameters.layout`.
        residuals: root mean squares.
    """

    factory: CameraTable | None = None
    sigma: dict[str, FiniteFloat] = Field(default_factory=dict)
    residuals: ResidualsTable = ResidualsTable()


class CalibratedSensor(SensorEvidence):
    """`[sensors.<name>]` of a calibration file; the other keys are those of the sensor in a rig file."""

    camera: CameraTable = CameraTable()
    noise: NoiseSettings | None = None
    texture: NoiseSettings | None = None
    outlier_share: Annotated[float, Field(gt=0, lt=1)] | None = None
    range_m: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    no_return: Annotated[Any, SettingsOf("calib.no_return")] | None = None
    depth: DepthTable | None = None
    time_offset_ms: OffsetMs | None = None


class CalibrationFile(Table):
    """A calibration file: calibrations of the sensors of a rig, and their provenance."""

    version: Literal[1]
    name: Name
    provenance: ProvenanceTable
    covariance: CovarianceTable | None = None
    sensors: dict[Name, CalibratedSensor]


class SensorOrigin(SensorEvidence):
    """Origin of one sensor's keys in a merged configuration.

    Attributes:
        keys: of `[sensors.<name>]` and its `camera` that the calibration file gave.
    """

    keys: tuple[str, ...]


class CalibrationOrigin(Table):
    """`[calibration]` of a merged configuration: the file whose content stands in the sensors' tables.

    Attributes:
        file: its name.
        sha256: hash of its content.
        provenance: as there.
        covariance: likewise.
        sensors: what it gave.
    """

    file: str
    sha256: str
    provenance: ProvenanceTable
    covariance: CovarianceTable | None = None
    sensors: dict[str, SensorOrigin] = Field(default_factory=dict)
