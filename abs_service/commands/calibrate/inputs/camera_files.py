"""Cameras are read from calibrations of any format."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from abs_service.calibration.files import exchange
from abs_service.commands.calibrate.inputs import calibrations
from abs_service.commands.parts.options import OptionError
from calib.camera import Camera
from calib.files import limited
from calib.formats import opencv, plausibility
from calib.formats.content import Content, Hints

#: Metres per unit, as values of `--unit`.
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}


def read_all(paths: Sequence[Path], hints: Hints, source: str | None, unit: str | None) -> list[Content]:
    """The cameras of several files; see `parse`. OpenCV's extrinsics.yml belongs to the intrinsics.yml beside it."""
    texts = [(path, text_of(path)) for path in paths]
    pairs = [one for one in texts if len(texts) > 1 and source in (None, "opencv") and opencv.is_pair(one[1])]
    if len(pairs) == 1:
        texts.remove(pairs[0])
        hints = replace(hints, pair=pairs[0][1])
    return [parse(path, text, hints, source, unit) for path, text in texts]


def read(path: Path, hints: Hints, unit: str) -> Content:
    """The cameras of a file; see `parse`."""
    return parse(path, text_of(path), hints, unit=unit)


def text_of(path: Path) -> str:
    """The text of a file.

    Raises:
        OptionError: it cannot be read, or holds something else.
    """
    try:
        return limited.text(path)
    except OSError as error:
        raise OptionError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise OptionError(f"{path}: all formats are UTF-8 text, byte {error.start} is not") from error


def parse(path: Path, text: str, hints: Hints, source: str | None = None, unit: str | None = None) -> Content:
    """The cameras of the text of a file.

    Args:
        path: the file.
        text: what it holds.
        hints: values that it omits.
        source: its format; None to detect it.
        unit: of its translations, one of `UNITS`; None if it is the format's.

    Raises:
        ExchangeError: its format is unknown, or it does not conform to it.
        OptionError: what it says cannot be.
    """
    name = source or exchange.of_content(path, text)
    if hints.lens and name != "opencv":
        raise OptionError(f"--lens {hints.lens}: {path} says itself which lens it has")
    if name == exchange.OWN:
        return _own(path)
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", path.stem).strip("_-") or "camera"
    content = exchange.read(path, text, name, replace(hints, name=stem))
    scaled = {key: _scaled(one, UNITS[unit or "m"]) for key, one in content.cameras.items()}
    _check(path, scaled, unit)
    return replace(content, cameras=scaled)


def _scaled(one: Camera, unit: float) -> Camera:
    """Camera whose translation was in another unit [m]."""
    T_rs = one.T_rs.copy()
    T_rs[:3, 3] *= unit
    return replace(one, T_rs=T_rs)


def _check(path: Path, cameras: Mapping[str, Camera], unit: str | None) -> None:
    """Refuses what no camera of a rig is, unless the unit was given."""
    for doubt in plausibility.doubts(cameras):
        raise OptionError(f"{path}: {doubt}")
    for pair, how in plausibility.baselines(cameras).items():
        if how.length > plausibility.MAX_BASELINE_M and unit is None:
            raise OptionError(
                f"{path}: {pair} are {how.length:.4g} m apart, if lengths are in metres; say what they are in with "
                f"--unit, one of {', '.join(UNITS)}"
            )


def _own(path: Path) -> Content:
    """Cameras of our own file."""
    known = calibrations.load(path)
    lost = ["the covariances"] if known.covariance.names else []
    for name, sensor in known.sensors.items():
        parts = {
            "depth terms": sensor.depth_offset or sensor.depth_scale,
            "time offset": sensor.time_offset,
            "noise model": sensor.noise,
            "texture": sensor.texture,
            "factory calibration": sensor.factory,
        }
        lost += [f"{name}: {part}" for part, given in parts.items() if given]
    return Content({name: sensor.camera for name, sensor in known.sensors.items()}, tuple(lost))
