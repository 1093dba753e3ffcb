"""Images with the tracked mesh drawn over them, as a film; needs PyAV."""

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from itertools import chain
from pathlib import Path

import av
import cv2
import numpy as np

from abs_service.api.estimate import Estimate
from abs_service.api.recording import Recording
from abs_service.display.page.pictures import Picture, grey, picture, with_mesh
from abs_service.export.errors import ExportError
from calib.camera import Camera
from drivers import replay
from drivers.contract.frame import Frame

#: Largest time by which an image may be later than the estimate drawn into it: half a period at 30 Hz [s].
LATER_S = 0.0167

#: Age from which an image is drawn as stale [s].
STALE_S = 0.5

#: Height of the line of text below the images [px].
TEXT_PX = 28

_UNIT = Fraction(1, 1000)


def write(estimates: Iterable[Estimate], recording: Recording, path: Path) -> int:
    """Writes an MP4 file (H.264) and returns its number of pictures: one for each estimate at which all streams are on.

    A picture has the newest image of each stream side by side, with the mesh; below, time and status. An old image is
    grey. Streams without a camera are left out.

    Raises:
        ExportError: there are no images of these moments.
        RecordingError: there are no images at all, or a part of the recording is damaged.
        OSError: the file cannot be written.
    """
    cameras = recording.cameras
    streams = sum(count > 0 and name.partition("/")[0] in cameras for name, count in recording.streams.items())
    frames = (frame.at_middle() for frame in replay.Recording(recording.path).images() if frame.sensor in cameras)
    pictures = ((one, _drawn(one, shown, cameras)) for one, shown in _moments(estimates, frames, streams))
    first = next(pictures, None)
    if first is None:
        raise ExportError(f"{recording.path}: no estimate has images of its moment")
    begin_s, written, last = first[0].time_s, 0, -1
    with av.open(str(path), "w", format="mp4") as file:
        stream = file.add_stream("libx264", rate=30, options={"crf": "20"})
        stream.height, stream.width = _with_text(first[1], "").shape[:2]
        stream.pix_fmt = "yuv420p"
        stream.codec_context.time_base = _UNIT
        for one, drawn in chain([first], pictures):
            time = round((one.time_s - begin_s) / _UNIT)
            if time <= last:
                continue
            frame = av.VideoFrame.from_ndarray(_with_text(drawn, f"{time / 1000:.2f} s  {one.status.value}"), "rgb24")
            frame.pts, frame.time_base = time, _UNIT
            file.mux(stream.encode(frame))
            written, last = written + 1, time
        file.mux(stream.encode())
    return written


def _moments(
    estimates: Iterable[Estimate], frames: Iterator[Frame], streams: int
) -> Iterator[tuple[Estimate, list[Frame]]]:
    """Estimates with the newest frame of each stream, from the first one at which there are all."""
    newest: dict[tuple[str, str], Frame] = {}
    following = next(frames, None)
    for one in estimates:
        while following is not None and following.t_host_ns * 1e-9 <= one.time_s + LATER_S:
            newest[following.key] = following
            following = next(frames, None)
        if len(newest) == streams > 0:
            yield one, [newest[key] for key in sorted(newest)]


def _drawn(estimate: Estimate, frames: Iterable[Frame], cameras: Mapping[str, Camera]) -> Picture:
    """Frames side by side, with the mesh."""
    drawn: list[Picture] = []
    for frame in frames:
        image = with_mesh(picture(frame), cameras[frame.sensor], estimate.vertices.astype(float), estimate.faces)
        is_stale = estimate.time_s - frame.t_host_ns * 1e-9 > STALE_S
        drawn.append(grey(image) if is_stale else image)
    height = max(len(image) for image in drawn)
    return np.hstack([np.pad(image, ((0, height - len(image)), (0, 0), (0, 0))) for image in drawn])


def _with_text(image: Picture, text: str) -> Picture:
    """The picture with a line of text below; its height is even, as the format requires."""
    below = np.zeros((TEXT_PX + len(image) % 2, image.shape[1], 3), np.uint8)
    cv2.putText(below, text, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 255), 1, cv2.LINE_AA)
    return np.vstack([image, below])
