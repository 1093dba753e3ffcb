"""Errors of reading ROS bags by `rosbags`, in words for people."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from drivers.encoding.foreign_recording import ForeignRecordingError


@contextmanager
def rosbag_errors(path: Path, kind: str) -> Iterator[None]:
    """Translates exceptions into a `ForeignRecordingError` that names the file and the remedy.

    Args:
        path: of the bag.
        kind: of bag that is read, such as "ROS 1".
    """
    try:
        yield
    except ForeignRecordingError:
        raise
    except ImportError as error:
        raise ForeignRecordingError(
            f"{path}: bags are read by rosbags, which the extra `import` of abs-service installs"
        ) from error
    except OSError as error:
        raise ForeignRecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # the parsers raise arbitrary exceptions for corrupt bytes
        what = f"{type(error).__name__}: {error}"  # the repr of a UnicodeDecodeError holds all that it could not decode
        raise ForeignRecordingError(f"{path}: this is no {kind} bag, or a damaged one: {what}") from error
