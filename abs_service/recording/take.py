"""One recording: a file with everything and, if asked for, a small one beside it with the estimates alone."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

from abs_service.recording.recording_file import RecordingFile, estimates_path
from abs_service.wire import message_header as header
from abs_service.wire.estimate_messages import MESH, STATE
from drivers.encoding.mcap_file import Compression

#: Messages of the file of the estimates: what was tracked, how well, and with what. Neither images and what describes
#: them, nor what can be made of these: point clouds of images, scenes of meshes.
_OF_ESTIMATES = frozenset(
    {STATE, MESH, header.TOPOLOGY, header.HEALTH, header.CONFIG, header.CALIBRATION, header.MODEL, header.TRANSFORMS}
)


class Take:
    """The files of one recording, which begin and end together.

    Args:
        path: of the file with everything.
        has_estimates: whether there is `x_estimates.mcap` beside `x.mcap`.
        wall_ns, attachments, compression, chunk_size, open_file: see `RecordingFile`.

    Raises:
        OSError: a file cannot be created; none is left.
    """

    def __init__(
        self,
        path: Path,
        has_estimates: bool,
        wall_ns: int,
        attachments: Mapping[str, str],
        compression: Compression,
        chunk_size: int,
        open_file: Callable[[Path], BinaryIO],
    ) -> None:
        def create(path: Path) -> RecordingFile:
            return RecordingFile(path, wall_ns, attachments, compression, chunk_size, open_file)

        self.path = path
        self._all = create(path)
        self._estimates: Sequence[RecordingFile] = ()
        self._topics: set[str] = set()  # of the file of the estimates
        if has_estimates:
            try:
                self._estimates = (create(estimates_path(path)),)
            except OSError:
                self._all.abandon().unlink(missing_ok=True)  # it holds no message
                raise

    @property
    def size(self) -> int:
        """Bytes of the file with everything so far, see `RecordingFile.size`."""
        return self._all.size

    @property
    def estimates_size(self) -> int:
        """Bytes of the file of the estimates so far; 0 if there is none."""
        return sum(file.size for file in self._estimates)

    @property
    def fate(self) -> str:
        """Change of an unfinished file from outside, "x.mcap was deleted", say; see `RecordingFile.fate`."""
        return next((f"{file.path.name} was {file.fate}" for file in (self._all, *self._estimates) if file.fate), "")

    def write(self, topic: str, message: str, payload: bytes, stamp_ns: int, seq: int) -> None:
        """Appends one message; see `RecordingFile.write`."""
        self._all.write(topic, message, payload, stamp_ns, seq)
        if message in _OF_ESTIMATES:
            for file in self._estimates:
                file.write(topic, message, payload, stamp_ns, seq)
                self._topics.add(topic)

    def attach(self, name: str, media_type: str, text: str, stamp_ns: int) -> None:
        """Adds an attachment; see `RecordingFile.attach`."""
        for file in (self._all, *self._estimates):
            file.attach(name, media_type, text, stamp_ns)

    def flush(self) -> None:
        """Flushes to the disk; see `RecordingFile.flush`."""
        for file in (self._all, *self._estimates):
            file.flush()

    def finish(self, summary: Mapping[str, str]) -> Path:
        """Finishes the files; see `RecordingFile.finish`.

        Of the counters, which are called `<cause>.<topic>`, the estimates' file has those of its topics.
        """
        # The file with everything comes last: as long as it is unfinished, `abandon` leaves it to be recovered.
        for file in self._estimates:
            file.finish({key: text for key, text in summary.items() if self._is_of_estimates(key)})
        return self._all.finish(summary)

    def abandon(self) -> Path:
        """Closes the files unfinished, to be recovered later; returns the path of that with everything."""
        for file in self._estimates:
            file.abandon()
        return self._all.abandon()

    def _is_of_estimates(self, key: str) -> bool:
        _, _, topic = key.partition(".")
        return not topic or topic in self._topics
