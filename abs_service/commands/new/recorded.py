"""A recording in place of a camera: its sensors are those that it has images of."""

import re
import shlex
from itertools import islice
from pathlib import Path
from urllib.parse import quote

import numpy as np

from abs_service.commands.new.rig_text import STRUCTURED_LIGHT, TIME_OF_FLIGHT, Color, Device
from calib.noise.fit.scatter import scatter
from calib.noise.structured_light import StructuredLight
from drivers.contract.frame import Frame
from drivers.contract.text import printable
from drivers.replay import Recording, RecordingError

#: Noise models of distances by a stream that the depth sensor has beside them; others are structured light or stereo.
_NOISE = {
    "deviation": """\
# The sensor tells the deviation of every distance; `floor` is what does not change from image to image [m].
noise = { type = "measured", factor = 1.0, floor = 0.003 }
""",
    "amplitude": TIME_OF_FLIGHT,
    "ir": TIME_OF_FLIGHT,
}
#: Noise model of distances that scatter more than those of a PrimeSense camera.
_SCATTERED = """\
# A starting point: so much distances scatter where the first images are flat, more than those of a PrimeSense camera;
# in inverse distance [1/m]. Measure yours with `abs-service calibrate noise`.
noise = {{ type = "structured_light", noise = {:.1f}e-3, step = 0.0 }}
"""
#: A head with such a name is a time-of-flight camera, whatever else it recorded.
_TIME_OF_FLIGHT_NAME = re.compile(r"(?<![a-z])tof(?![a-z])", re.IGNORECASE)

_PRIMESENSE = StructuredLight()
#: A smaller excess is no evidence: images differ.
_MORE = 1.2

#: Number of images of whose scatter the median is taken.
_IMAGES = 5

#: Noise models of colours by their stream.
_COLORS = {"color": '{ type = "color", sigma = 20.0 }', "bayer": '{ type = "bayer", sigma = 25.0 }'}


def device(path: Path) -> Device:
    """The device that plays a recording: its first depth sensor, and its first colour camera if there is one.

    Raises:
        RecordingError: the file cannot be read, or has no depth images.
    """
    recording = Recording(path)
    heads = [head for head, stream in recording.counts if stream == "depth"]
    if not heads:
        raise RecordingError(f"{path}: there are no depth images in it, so nothing can be tracked")
    head = min(heads)
    noise, assumed = _noise(recording, head)
    colors = sorted((sensor, stream) for sensor, stream in recording.counts if stream in _COLORS)
    first = recording.first_frames().get((head, "depth"))
    if first is None:
        raise RecordingError(f"{path}: {head}/depth has no frame that can be read")
    period_s = 1 / recording.rate_hz(first) if recording.counts[first.key] > 1 else 0.0
    shown = printable(shlex.quote(str(path)))
    others = ", ".join(printable(other) for other in sorted(set(heads)) if other != head)
    note = f"Depth images of {printable(head)}; the recording has those of {others} as well." if others else ""
    return Device(
        f"recording {printable(path.name)}",
        f"replay://{quote(str(path.resolve()))}",
        head,
        noise,
        Color(colors[0][0], _COLORS[colors[0][1]]) if colors else None,
        round(500.0 * period_s, 1) or 17.0,
        min(2.0, max(0.5, round(recording.duration_s / 2, 1))),
        address="\n# ".join(filter(None, (f"The recording; `abs-service info {shown}` describes it.", note))),
        note=" ".join(filter(None, (note, assumed))),
        commands=(
            "abs-service check {file} --picture first.png",
            f"abs-service replay {shown} --images --config " + "{file}",
        ),
    )


def _noise(recording: Recording, head: str) -> tuple[str, str]:
    """Noise model of a head with comments, and what had to be assumed for it, for people; "" if that is nothing."""
    # Two infra-red images are a stereo pair, one of which the distances were computed for.
    is_pair = sum(stream == "ir" for _, stream in recording.counts) > 1
    for stream, model in _NOISE.items():
        if (head, stream) in recording.counts and not (stream == "ir" and is_pair):
            return model, ""
    if _TIME_OF_FLIGHT_NAME.search(head):
        return TIME_OF_FLIGHT, ""
    assumed = (
        f"{printable(head)} is taken for structured light or stereo, as it has no amplitudes beside its distances.",
        'Of a time-of-flight camera write noise = { type = "constant", sigma = 0.01 } instead.',
    )
    return "".join(f"# {line}\n" for line in assumed) + _structured_light(recording, head), " ".join(assumed)


def _structured_light(recording: Recording, head: str) -> str:
    """Noise model of a head: that of a PrimeSense camera, or more if its first depth images scatter more."""
    frames = (frame for frame in recording.frames({(head, "depth")}) if isinstance(frame, Frame))
    measured = np.median([scatter(frame.si()) for frame in islice(frames, _IMAGES)] or [np.nan])
    typical = np.hypot(_PRIMESENSE.noise, _PRIMESENSE.step / np.sqrt(12))
    return _SCATTERED.format(measured * 1e3) if measured > _MORE * typical else STRUCTURED_LIGHT
