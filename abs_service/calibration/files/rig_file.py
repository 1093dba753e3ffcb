"""Calibration file: sensors of a rig as TOML, with covariances in a side file.

Read by `abs_service.config.load_calibration`, and through rig files that name it.
"""

import hashlib
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.files import toml_text
from abs_service.report.provenance import Provenance
from calib import pose
from calib.camera import Camera
from calib.files import atomic, limited


class RigFileError(Exception):
    """Calibration file that cannot be written, or an invalid side file."""


@dataclass(frozen=True, slots=True)
class Residuals:
    """Root mean square residuals of a calibration; None without measurements.

    Attributes:
        corners_px: of corners [px].
        distances: of distances on boards [m].
        views: number of images that showed the board.
        poses: number of distinct poses of the board in them.
    """

    corners_px: float | None = None
    distances: float | None = None
    views: int | None = None
    poses: int | None = None


@dataclass(frozen=True)
class SensorCalibration:
    """Calibration of one optical head.

    Attributes:
        camera: projection with its pose in the rig.
        depth_offset, depth_scale: measured distance = (1 + scale) · distance + offset [m, 1].
        time_offset: offset from the sensor's clock to the rig's [s]; added to the sensor's times.
        noise: TOML table of its noise model; empty without one. Paths are relative to the folder of the calibration
            file.
        texture: likewise for its amplitude, intensity or colour.
        factory: the device's own calibration; None if unknown.
        residuals: of the calibration.
    """

    camera: Camera
    depth_offset: float = 0.0
    depth_scale: float = 0.0
    time_offset: float = 0.0
    noise: Mapping[str, Any] = field(default_factory=dict)
    texture: Mapping[str, Any] = field(default_factory=dict)
    factory: Camera | None = None
    residuals: Residuals = Residuals()


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of all estimated parameters.

    Attributes:
        names: of the parameters, `tof.fx`, `color.rotation_x`, …; see `calib.solve.bundle.parameters.layout`.
        matrix: (n, n), in the product of their units (m, rad, px, s, 1).
        views: digests of the corners that they were estimated from; empty if unknown.
    """

    names: tuple[str, ...] = ()
    matrix: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    views: tuple[str, ...] = ()

    def of(self, sensor: str) -> dict[str, float]:
        """Standard deviations of a sensor's parameters, by name without the sensor."""
        sigmas = np.sqrt(np.diag(self.matrix))
        owners = [name.partition(".") for name in self.names]
        return {name: float(sigma) for (owner, _, name), sigma in zip(owners, sigmas) if owner == sensor}


@dataclass(frozen=True)
class RigCalibration:
    """Complete content of a calibration file."""

    name: str
    sensors: Mapping[str, SensorCalibration]
    provenance: Provenance
    verdict: Literal["good", "doubtful", "bad", "unknown"] = "unknown"
    covariance: Covariance = field(default_factory=Covariance)


def write(calibration: RigCalibration, path: Path) -> list[Path]:
    """Writes a calibration file, with its covariances beside it if there are any; returns the paths of both.

    Raises:
        RigFileError: a file cannot be written.
    """
    side = path.with_suffix(".npz")
    arrays = _arrays(calibration.covariance) if calibration.covariance.names else b""
    digest = hashlib.sha256(arrays).hexdigest()
    beside = {"file": side.name, "sha256": digest} if arrays else {}
    try:
        if arrays:
            atomic.write(side, arrays)
        atomic.write(path, _text(calibration, path.name, beside))
    except OSError as error:
        raise RigFileError(f"{error.filename}: the calibration cannot be written: {error.strerror}") from error
    return [path, side] if arrays else [path]


def read_covariance(path: Path, sha256: str) -> Covariance:
    """Covariances of a side file.

    Raises:
        RigFileError: it cannot be read, or its hash differs.
    """
    try:
        content = limited.read(path, limited.MAX_ARRAYS_BYTES)
    except OSError as error:
        raise RigFileError(f"{path}: the covariances cannot be read: {error.strerror}") from error
    if hashlib.sha256(content).hexdigest() != sha256:
        raise RigFileError(f"{path}: not the covariances of this calibration, for which the hash must be {sha256}")
    try:
        arrays = limited.unpacked(content)
        views = arrays["views"].tolist() if "views" in arrays else ()
        return Covariance(tuple(arrays["names"].tolist()), arrays["covariance"], tuple(views))
    except (KeyError, ValueError) as error:
        raise RigFileError(f"{path}: the covariances cannot be read: {error}") from error


def camera_table(camera: Camera) -> dict[str, Any]:
    """Table `camera` of a rig file for a camera."""
    rotation_vector, translation = pose.to_rotation_vector(camera.T_rs)
    coefficients = np.trim_zeros(camera.lens.coefficients, "b").tolist()
    return {
        **{key: getattr(camera, key) for key in ("width", "height")},
        **{key: float(getattr(camera, key)) for key in ("fx", "fy", "cx", "cy")},
        "lens_model": camera.lens.name,
        "lens": coefficients,
        "T_rs": {"rotation_vector": rotation_vector.tolist(), "translation": translation.tolist()},
    }


def _arrays(covariance: Covariance) -> bytes:
    buffer = io.BytesIO()
    views = np.array(covariance.views, np.str_)
    np.savez(buffer, names=np.array(covariance.names), covariance=covariance.matrix, views=views)
    return buffer.getvalue()


def _text(calibration: RigCalibration, name: str, beside: Mapping[str, str]) -> str:
    provenance = calibration.provenance
    parts = [
        f'# Calibration of rig {calibration.name}. A rig file uses it by the line\n#\n#   calibration = "{name}"\n#\n'
        "# and returns to the devices' own calibration without that line. Units: m, rad, s and what a key ends in;\n"
        "# camera matrices in px. T_rs maps the sensor's coordinates to the rig's.\n",
        toml_text.table((), {"version": 1, "name": calibration.name}),
        toml_text.table(
            ("provenance",),
            {
                "command": provenance.command,
                "date": provenance.date,
                "version": provenance.version,
                "verdict": calibration.verdict,
                "data": [{"name": one.name, "sha256": one.sha256} for one in provenance.data],
            },
        ),
    ]
    if beside:
        comment = "Of all parameters together; NumPy's format, arrays `names`, `covariance`, `views` (digests)."
        parts.append(toml_text.table(("covariance",), beside, comment))
    for sensor, known in calibration.sensors.items():
        parts += _sensor(("sensors", sensor), known, calibration.covariance.of(sensor))
    return "\n".join(parts)


def _sensor(key: tuple[str, ...], known: SensorCalibration, sigma: Mapping[str, float]) -> list[str]:
    parts = [toml_text.table((*key, "camera"), camera_table(known.camera))]
    if known.time_offset:
        parts.insert(0, toml_text.table(key, {"time_offset_ms": known.time_offset * 1e3}))
    if known.depth_offset or known.depth_scale:
        terms = {"offset": known.depth_offset, "scale": known.depth_scale}
        parts.append(toml_text.table((*key, "depth"), terms, "measured = (1 + scale) · distance + offset [m]"))
    if known.noise:
        parts.append(toml_text.table((*key, "noise"), known.noise))
    if known.texture:
        parts.append(toml_text.table((*key, "texture"), known.texture))
    rms = {key: getattr(known.residuals, key) for key in ("corners_px", "distances", "views", "poses")}
    left = {name: value for name, value in rms.items() if value is not None}
    if left:
        parts.append(toml_text.table((*key, "residuals"), left, "root mean square residuals [px, m]"))
    if sigma:
        comment = "standard deviations; rotations [rad] about the axes of the rig, x, y, z [m], fx … cy [px]"
        parts.append(toml_text.table((*key, "sigma"), sigma, comment))
    if known.factory is not None:
        parts.append(toml_text.table((*key, "factory"), camera_table(known.factory), "the device's own calibration"))
    return parts
