"""Sizes of a sensor's images, which have to be the same in all shots: a camera is calibrated for one size."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from abs_service.calibration.shots.shots import SensorShot, Shot, ShotsError
from calib.camera import Camera


def checked(shots: Iterable[Shot]) -> Iterator[Shot]:
    """Shots in which every sensor's images have the size of its first one.

    Raises:
        ShotsError: an image has another size; names both.
    """
    # Distances may have another size than the image, and either may be missing in a shot.
    first: dict[tuple[str, bool], tuple[tuple[int, int], str]] = {}
    for shot in shots:
        for sensor, look in shot.sensor_shots.items():
            if (size := _size(look)) is None:
                continue
            before, there = first.setdefault((sensor, bool(look.image.size)), (size, _source(shot, look)))
            if size != before:
                turned = "Was it turned by 90°? Then turn it back, or leave" if size == before[::-1] else "Leave"
                raise ShotsError(
                    f"{_source(shot, look)}: the image of {sensor} is {_text(size)}, but {_text(before)} in {there}; "
                    f"all images of a sensor must have one size. {turned} out those of the other size, "
                    f"such as by --skip {shot.number}"
                )
        yield shot


def checked_for(shots: Iterable[Shot], cameras: Mapping[str, Camera], calibration: Path) -> Iterator[Shot]:
    """Shots in which every sensor's images have the size that its stored camera is for.

    Args:
        shots: the shots.
        cameras: stored cameras, by sensor name; other sensors are not checked.
        calibration: their file, for messages.

    Raises:
        ShotsError: an image has another size; names both.
    """
    for shot in shots:
        for sensor, look in shot.sensor_shots.items():
            size, camera = _size(look), cameras.get(sensor)
            if size is not None and camera is not None and size != (camera.width, camera.height):
                alike = [name for name, other in cameras.items() if size == (other.width, other.height)]
                hint = (
                    f"that is the size of {' and '.join(alike)}: are the names exchanged? Otherwise " if alike else ""
                )
                raise ShotsError(
                    f"{_source(shot, look)}: the image of {sensor} is {_text(size)}, but its camera in {calibration} "
                    f"is for {_text((camera.width, camera.height))}; {hint}take images of that size, "
                    f"or scale the camera: abs-service calibrate convert --size {size[0]}x{size[1]} --sensor {sensor}"
                )
        yield shot


def _size(look: SensorShot) -> tuple[int, int] | None:
    """Width and height [px] of the image, or of the distances where there is none; None without either."""
    shown = look.image if look.image.size else look.distance
    return (shown.shape[1], shown.shape[0]) if shown.size else None


def _source(shot: Shot, look: SensorShot) -> str:
    return f"shot {shot.number}" if look.file is None else str(look.file)


def _text(size: tuple[int, int]) -> str:
    return f"{size[0]} × {size[1]} pixels"
