"""The text of a rig file, made of parts that the answers choose."""

import json
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Color:
    """A colour camera: name of its sensor, and its noise model."""

    head: str
    noise: str


@dataclass(frozen=True)
class Device:
    """A kind of device: description, address without a serial number, and tables of its sensors.

    Attributes:
        text: for people.
        uri: address of the only one that is attached.
        head: name of its depth sensor.
        noise: noise model of distances, with a comment.
        color: its colour camera, if there is one.
        tolerance_ms: largest difference of two images of one moment [ms].
        motion_s: time within which an object shows itself by its motion [s].
        controls: table of controls.
        address: comment on the address.
        note: for people, on what was chosen among several.
        commands: to use a rig file with, in this order; `{file}` is its path.
    """

    text: str
    uri: str
    head: str
    noise: str
    color: Color | None = Color("color", '{ type = "color", sigma = 20.0 }')
    tolerance_ms: float = 17.0
    motion_s: float = 2.0
    controls: str = ""
    address: str = "`abs-service devices` lists the addresses of the cameras that are attached."
    note: str = ""
    commands: tuple[str, ...] = ("abs-service check {file}", "abs-service run {file}")


@dataclass(frozen=True)
class Answers:
    """Description of a rig, from which its file is written.

    Attributes:
        name: of the rig.
        device: its only one.
        uri: address of the device.
        object: one of `OBJECTS`.
        size: lengths of the sides of a sheet of known size [m].
        color: True if its colour camera is used.
        behind: one of `BEHIND`.
    """

    name: str
    device: Device
    uri: str
    object: str
    size: tuple[float, float]
    color: bool
    behind: str


STRUCTURED_LIGHT = """\
# A starting point, that of a PrimeSense camera: random error and step, both in inverse distance [1/m]. Measure yours
# with `abs-service calibrate noise`.
noise = { type = "structured_light", noise = 1.425e-3, step = 2.85e-3 }
"""

STEREO = """\
# A starting point, that of a RealSense D435: 0.08 px of disparity, whose errors neighbouring pixels share, in inverse
# distance [1/m]. Measure yours with `abs-service calibrate noise`.
noise = { type = "structured_light", noise = 4.2e-3, step = 0.0 }
"""

TIME_OF_FLIGHT = """\
# A starting point: 1 cm. Measure yours with `abs-service calibrate noise`.
noise = { type = "constant", sigma = 0.01 }
"""

_AZURE = '"color.exposure_s" = 0.0166\n"color.auto_white_balance" = false\n'
DEVICES: Mapping[str, Device] = {
    "simulated": Device(
        "the simulated camera, nothing to connect",
        "simulated://sheet?seed=1",
        "tof",
        "# Deviation [m]: row i belongs to the power i of the distance [m], column j to that of the amplitude.\n"
        'noise = { type = "gaussian_polynomial", sigma = [[1.0425e-2, -2.8187e-6, 3.5261e-10, -1.5195e-14], '
        "[5.0e-4, 0.0, 0.0, 0.0]], amplitudes = [400.0, 10000.0] }\n",
        Color("color", '{ type = "color", sigma = 4.0 }'),
        12.0,
    ),
    "kinect1": Device(
        "Kinect v1, for Xbox 360 or Windows",
        "kinect1://",
        "depth",
        "# The disparity's random error (Khoshelham and Elberink, 2012) and its step, both in inverse distance [1/m].\n"
        'noise = { type = "structured_light", noise = 1.425e-3, step = 2.89e-3 }\n',
        Color("color", '{ type = "bayer", sigma = 25.0 }'),
        controls="auto_exposure = false\nauto_white_balance = false\nexposure_s = 0.02\n",
    ),
    "realsense": Device("Intel RealSense", "realsense://", "depth", STEREO),
    "oak-stereo": Device("OAK with stereo cameras", "oak://?mode=stereo", "depth", STEREO),
    "oak-tof": Device("OAK with a time-of-flight camera", "oak://?mode=tof", "tof", TIME_OF_FLIGHT),
    "orbbec-stereo": Device("Orbbec Gemini", "orbbec://", "depth", STEREO),
    "orbbec-tof": Device("Orbbec Femto", "orbbec://", "depth", TIME_OF_FLIGHT),
    "azure": Device("Azure Kinect", "azure://", "depth", TIME_OF_FLIGHT, controls=_AZURE),
}

OBJECTS: Mapping[str, str] = {
    "known-sheet": "a sheet of paper or card of known size",
    "sheet": "any sheet: paper, cloth, foil",
    "body": "a soft body that bends and stretches",
    "strip": "a strip that hangs from a gripper",
    "rigid": "a rigid thing",
}

BEHIND: Mapping[str, str] = {
    "space": "nothing near; the object is the nearest thing in view",
    "plane": "a table or a wall that the object lies on or stands on",
    "things": "other things, some of them nearer; the object moves",
}

_MODELS = {
    "known-sheet": """\
# A sheet that keeps its size and bends in two directions at once. It is found flat, facing the camera.
model = {{ type = "flexpad", width_m = {size[0]:g}, height_m = {size[1]:g} }}
""",
    "sheet": """\
# A smooth surface, made from the first depth image.
model = {{ type = "nurbs" }}
""",
    "body": """\
# A smooth surface, made from the first depth image: the side that the camera sees.
model = {{ type = "nurbs" }}
mesh = {{ vertices = 600 }}
priors = {{ stretch = 0.1 }} # soft things stretch; change of an edge's length relative to it
vertex_offsets = {{ random_walk = 1.6e-3 }} # what the surface cannot follow is learnt [m in a second]
""",
    "strip": """\
# Segments of constant curvature below a gripper; the free length is the detected one (docs/explanation/gravity.md).
# `gravity` is downwards in the images of a level camera.
model = {{ type = "gravity", segments = 8, gravity = [0.0, 1.0, 0.0] }}
""",
    "rigid": """\
# It does not bend: rotation and translation. Its mesh is made from the first depth image. With a file of its shape,
# template = {{ type = "mesh", path = "thing.obj" }} knows its back, too (docs/how-to/templates.md).
model = {{ type = "rigid" }}
""",
}

_REGIONS = {
    "space": """\
# The object is the surface nearest to the camera when tracking begins.
region = {{ type = "nearest" }}
""",
    "plane": """\
# The object is what stands out from the largest plane in view by more than clearance_m when tracking begins.
# What lies flat on it does not; region = {{ type = "seed", pixel = [column, row], grow = "color" }} finds it by colour.
region = {{ type = "above_plane", clearance_m = 0.01 }}
""",
    "things": """\
# The object is what moves within the first {motion_s} seconds; everything else has to rest meanwhile.
region = {{ type = "seed", motion_s = {motion_s} }}
""",
}

_CONTROLS = """
# A picture can only be compared with the next one if the camera does not change what it makes of the light.
[devices.camera.controls]
{controls}"""

_COLOR = """
# `sigma`, in levels of 256, is what differs between a picture and its prediction, not only the camera's noise.
[sensors.{color.head}]
device = "camera"
noise = {color.noise}
"""

_FILE = """\
# {what}.
# Camera: {device.text}.
# Behind the object: {behind}.
#
# Written by `abs-service new`. Every other key: docs/reference/configuration.md.
#
{commands}

version = 1
name = "{answers.name}" # on the wire: keys are abs/{answers.name}/…

# {device.address}
[devices.camera]
uri = {uri}
{controls}
# The depth camera. `noise` is its noise model, which weighs every measurement.
[sensors.{device.head}]
device = "camera"
{device.noise}{color}
# Every exposure of this stream becomes an estimate; images of the others may be so far away in time.
[synchronisation]
reference = "{device.head}/depth"
tolerance_ms = {device.tolerance_ms}

[trackers.object]
sensors = [{sensors}]

{model}
{region}
# Everything that is published, as MCAP, in the folder of this file.
[record]
directory = "recordings"
"""


def write(answers: Answers, file: str) -> str:
    """The rig file, TOML with comments."""
    device = answers.device
    color = device.color if answers.color else None
    sensors = [device.head, *([color.head] if color else [])]
    return _FILE.format(
        what=OBJECTS[answers.object].capitalize(),
        behind=BEHIND[answers.behind],
        commands="\n".join(f"#   {command}" for command in commands(device, file)),
        uri=json.dumps(answers.uri),
        answers=answers,
        device=device,
        controls=_CONTROLS.format(controls=device.controls) if device.controls else "",
        color=_COLOR.format(color=color) if color else "",
        sensors=", ".join(f'"{sensor}"' for sensor in sensors),
        model=_MODELS[answers.object].format(size=answers.size),
        region=_REGIONS[answers.behind].format(motion_s=device.motion_s),
    )


def commands(device: Device, file: str) -> list[str]:
    """The commands to use a rig file with."""
    return [command.replace("{file}", file) for command in device.commands]
