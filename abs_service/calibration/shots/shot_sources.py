"""Offline sources of shots: recordings and image folders."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from abs_service.calibration.shots.shots import USED, Assembler, SensorShot, Shot, ShotsError, thinned
from abs_service.pairing.synchroniser import Synchroniser
from calib.camera import Camera
from drivers.contract.frame import FrameSet
from drivers.image_folder import image_file
from drivers.image_folder.listing import ImageFile, ImageFolderError, by_number, changing_numbers, last_number
from drivers.replay.recording import Recording

#: Largest time difference between images of one shot [ns].
TOLERANCE_NS = 12_000_000


@dataclass(frozen=True)
class RecordingShots:
    """Shots of a recording.

    Attributes:
        recording: the file.
        every_s: minimum interval between shots [s].
        tolerance_ns: largest time difference between images of one shot [ns].
        cameras: replacements for the recording's cameras, by sensor name.
    """

    recording: Recording
    every_s: float = 0.5
    tolerance_ns: int = TOLERANCE_NS
    cameras: Mapping[str, Camera] | None = None

    def __iter__(self) -> Iterator[Shot]:
        """Iterates over the recording.

        Raises:
            ShotsError: no image that can show corners or planes.
            RecordingError: a part of the file is damaged.
        """
        return thinned(self._sets(), Assembler(self.cameras or self.recording.cameras), self.every_s)

    def _sets(self) -> Iterator[FrameSet]:
        kinds = {key: frame.kind for key, frame in self.recording.first_frames().items()}
        used = [key for key, kind in kinds.items() if kind in USED]
        if not used:
            raise ShotsError(f"{self.recording.path}: no image in it shows a board: {', '.join(map('/'.join, kinds))}")
        # The slowest stream determines the number of shots.
        reference = min(used, key=lambda key: self.recording.counts[key])
        synchroniser = Synchroniser(reference, used, self.tolerance_ns)
        yield from synchroniser.group(self.recording.images(used))


@dataclass(frozen=True)
class FolderShots:
    """Shots of image folders: files with the same last number in their names belong to one shot.

    Images of a sensor may share last numbers, such as the seconds of times of the day: then shots are counted from 0 in
    the order of all numbers in the names, and images of several sensors belong together that agree in all that change.

    Attributes:
        patterns: path of each sensor's images, by sensor name; the last part may hold wildcards.
    """

    patterns: Mapping[str, str]

    def __iter__(self) -> Iterator[Shot]:
        """Iterates over the images.

        Raises:
            ShotsError: no file matches, a file has no number or is no image, or nothing tells which images belong
                together; names it.
        """
        files = _numbered({sensor: self._files(sensor, pattern) for sensor, pattern in self.patterns.items()})
        for number in sorted({seq for numbered in files.values() for seq in numbered}):
            yield Shot(number, {s: _look(numbered[number]) for s, numbered in files.items() if number in numbered})

    def _files(self, sensor: str, pattern: str) -> list[ImageFile]:
        path = Path(pattern)
        if path.is_dir():
            raise ShotsError(f"images of {sensor}: {path} is a folder: name the images in it, such as '{path}/*.png'")
        if not path.parent.is_dir() and re.search(r"[*?[]", str(path.parent)):
            raise ShotsError(
                f"images of {sensor}: {path.parent}: no such folder; only the name of the images, after the "
                "last '/', may hold wildcards: * ? ["
            )
        try:
            return by_number(path.parent, path.name, rate_hz=1.0, alone=True)
        except ImageFolderError as error:
            raise ShotsError(f"images of {sensor}: {error}") from error


def _numbered(files: Mapping[str, Sequence[ImageFile]]) -> dict[str, dict[int, ImageFile]]:
    """Files by sensor and number of the shot."""
    repeated = [s for s, own in files.items() if any(file.seq != last_number(file.path.stem) for file in own)]
    if len(files) == 1 or not repeated:
        return {sensor: {file.seq: file for file in own} for sensor, own in files.items()}
    moments = {
        sensor: dict(zip(changing_numbers([file.path.stem for file in own]), own)) for sensor, own in files.items()
    }
    every = sorted({moment for own in moments.values() for moment in own})
    if len(every) == sum(map(len, moments.values())):
        raise ShotsError(
            f"images of {repeated[0]}: their last numbers repeat, such as in {files[repeated[0]][0].path.name}, and no "
            "other numbers tell which images belong together: let the last one count the exposures"
        )
    return {sensor: {every.index(moment): file for moment, file in own.items()} for sensor, own in moments.items()}


def _look(file: ImageFile) -> SensorShot:
    try:
        image = image_file.read(file.path)
    except ImageFolderError as error:
        raise ShotsError(str(error)) from error
    return SensorShot(file.t_ns, image, image, file=file.path)
