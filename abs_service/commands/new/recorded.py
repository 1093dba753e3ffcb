"""A recording in place of a camera: its sensors are those that it has images of."""

import shlex
from pathlib import Path
from urllib.parse import quote

from abs_service.commands.new.rig_text import STRUCTURED_LIGHT, TIME_OF_FLIGHT, Color, Device
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
    noise = (model for stream, model in _NOISE.items() if (head, stream) in recording.counts)
    colors = sorted((sensor, stream) for sensor, stream in recording.counts if stream in _COLORS)
    period_s = recording.duration_s / max(1, recording.counts[head, "depth"] - 1)
    shown = printable(shlex.quote(str(path)))
    others = ", ".join(printable(other) for other in sorted(set(heads)) if other != head)
    note = f"Depth images of {printable(head)}; the recording has those of {others} as well." if others else ""
    return Device(
        f"recording {printable(path.name)}",
        f"replay://{quote(str(path.resolve()))}",
        head,
        next(noise, STRUCTURED_LIGHT),
        Color(colors[0][0], _COLORS[colors[0][1]]) if colors else None,
        round(500.0 * period_s, 1) or 17.0,
        min(2.0, max(0.5, round(recording.duration_s / 2, 1))),
        address="\n# ".join(filter(None, (f"The recording; `abs-service info {shown}` describes it.", note))),
        note=note,
        commands=(
            "abs-service check {file} --picture first.png",
            f"abs-service replay {shown} --images --config " + "{file}",
        ),
    )
