"""Where shots come from offline: recordings, and folders of images."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2

from abs_service.calibration.shots.shots import USED, Assembler, Look, Shot, ShotsError, thinned
from abs_service.pairing.synchroniser import Synchroniser
from calib.camera import Camera
from drivers.contract.frame import Frame, FrameSet
from drivers.image_folder.listing import ImageFile, ImageFolderError, by_number
from drivers.replay.recording import Recording

#: Largest difference between the stamps of images that show one moment [ns].
TOLERANCE_NS = 12_000_000


@dataclass(frozen=True)
class RecordingShots:
    """The shots of a recording.

    Attributes:
        recording: the file.
        every_s: least time between two shots [s].
        tolerance_ns: largest difference between the stamps of images that show one moment [ns].
        cameras: cameras in place of those that the recording names, by sensor name.
    """

    recording: Recording
    every_s: float = 0.5
    tolerance_ns: int = TOLERANCE_NS
    cameras: Mapping[str, Camera] | None = None

    def __iter__(self) -> Iterator[Shot]:
        """Reads the recording through.

        Raises:
            ShotsError: it holds no image in which corners or planes can be sought.
            RecordingError: a part of it is damaged.
        """
        return thinned(self._sets(), Assembler(self.cameras or self.recording.cameras), self.every_s)

    def _sets(self) -> Iterator[FrameSet]:
        kinds = {frame.key: frame.kind for frame in self._first_frames()}
        used = [key for key, kind in kinds.items() if kind in USED]
        if not used:
            raise ShotsError(f"{self.recording.path}: no image in it shows a board: {', '.join(map('/'.join, kinds))}")
        # The slowest stream decides how many moments there are.
        reference = min(used, key=lambda key: self.recording.counts[key])
        synchroniser = Synchroniser(reference, used, self.tolerance_ns)
        for item in self.recording.frames():
            if isinstance(item, Frame) and item.key in used:
                yield from synchroniser.add(item)
        yield from synchroniser.flush()

    def _first_frames(self) -> Iterator[Frame]:
        missing = set(self.recording.counts)
        for item in self.recording.frames():
            if isinstance(item, Frame) and item.key in missing:
                missing.discard(item.key)
                yield item
            if not missing:
                return


@dataclass(frozen=True)
class FolderShots:
    """The shots of folders of images: files with the same last number in their names show the same moment.

    Attributes:
        patterns: where each sensor's images are, by sensor name: a path whose last part may hold wildcards.
    """

    patterns: Mapping[str, str]

    def __iter__(self) -> Iterator[Shot]:
        """Reads image after image.

        Raises:
            ShotsError: no file matches, one has no number or is no image; names it.
        """
        files = {sensor: self._files(sensor, pattern) for sensor, pattern in self.patterns.items()}
        for number in sorted({seq for numbered in files.values() for seq in numbered}):
            yield Shot(number, {s: _look(numbered[number]) for s, numbered in files.items() if number in numbered})

    def _files(self, sensor: str, pattern: str) -> dict[int, ImageFile]:
        path = Path(pattern)
        try:
            return {file.seq: file for file in by_number(path.parent, path.name, rate_hz=1.0)}
        except ImageFolderError as error:
            raise ShotsError(f"images of {sensor}: {error}") from error


def _look(file: ImageFile) -> Look:
    # As the sensor made it: other flags would turn it by what a phone's compass says.
    image = cv2.imread(str(file.path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ShotsError(f"{file.path}: this is no image that can be read")
    return Look(file.t_ns, image, image)
