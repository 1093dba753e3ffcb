"""Sizes of a sensor's images, which have to be the same in all shots: a camera is calibrated for one size."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from abs_service.calibration.shots.shots import SensorShot, Shot, ShotsError
from calib.camera import Camera
from calib.solve.regrouping.two_groups import numbered

#: Sensor, and True for its image, False for distances without one.
_Kind = tuple[str, bool]

#: Width and height [px].
_Size = tuple[int, int]


def checked(shots: Iterable[Shot]) -> Iterator[Shot]:
    """Shots in which every sensor's images have the size of its first one.

    Raises:
        ShotsError: an image has another size; names both.
    """
    # Distances may have another size than the image, and either may be missing in a shot.
    first: dict[_Kind, tuple[_Size, str]] = {}
    numbers: dict[_Kind, dict[_Size, set[int]]] = {}
    every = iter(shots)
    for shot in every:
        for kind, look, size in _sized(shot):
            before, there = first.setdefault(kind, (size, _source(shot, look)))
            numbers.setdefault(kind, {}).setdefault(size, set()).add(shot.number)
            if size != before:
                following = every if look.file is not None else ()  # the images of a device never end
                turned = "Was it turned by 90°? Then turn it back, or leave" if size == before[::-1] else "Leave"
                raise ShotsError(
                    f"{_source(shot, look)}: the image of {kind[0]} is {_text(size)}, but {_text(before)} in {there}; "
                    f"all images of a sensor must have one size. {turned} out those of the other size, "
                    f"such as by --skip {_fewer(numbers[kind], following, kind)}"
                )
        yield shot


def _fewer(found: dict[_Size, set[int]], following: Iterable[Shot], kind: _Kind) -> str:
    """Numbers of the shots whose images have not the most frequent size, with those that follow the ones found."""
    for shot in following:
        for other, _, size in _sized(shot):
            if other == kind:
                found.setdefault(size, set()).add(shot.number)
    most = max(found.values(), key=len)
    return numbered({number for own in found.values() for number in own} - most)


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


def _sized(shot: Shot) -> Iterator[tuple[_Kind, SensorShot, _Size]]:
    """Images, or distances without one, of every sensor that has any, with their size."""
    for sensor, look in shot.sensor_shots.items():
        if (size := _size(look)) is not None:
            yield (sensor, bool(look.image.size)), look, size


def _size(look: SensorShot) -> _Size | None:
    """Width and height [px] of the image, or of the distances where there is none; None without either."""
    shown = look.image if look.image.size else look.distance
    return (shown.shape[1], shown.shape[0]) if shown.size else None


def _source(shot: Shot, look: SensorShot) -> str:
    return f"shot {shot.number}" if look.file is None else str(look.file)


def _text(size: tuple[int, int]) -> str:
    return f"{size[0]} × {size[1]} pixels"
