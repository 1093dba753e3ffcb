"""Keys and topics: a zenoh key is `abs/<rig>/<topic>`, the topic of a recording is `/<topic>`."""

from drivers.contract.text import is_name

ROOT = "abs"
CONFIG = "config"
SCHEMA = "schema"
TRANSFORMS = "tf"
#: Topic of commands to the recorder: queries with an absmsg.v1.Record.
RECORD = "record"
#: Topic of commands to read the rig file again: queries with an absmsg.v1.Reload.
RELOAD = "reload"

#: Coordinate frame that all poses and vertices refer to.
RIG_FRAME = "rig"

#: First parts of topics, not allowed as names of sensors, devices and trackers.
RESERVED = frozenset({CONFIG, SCHEMA, TRANSFORMS, "clock", "health", "live", RECORD, RELOAD})


class KeyNameError(ValueError):
    """A name that cannot be part of a key."""


def check_name(name: str) -> str:
    """Returns `name` if a rig, sensor, stream, device or tracker may be called so.

    Raises:
        KeyNameError: it is empty, reserved, or holds a character with a meaning in keys.
    """
    if not is_name(name):
        raise KeyNameError(f"{name!r} is no name: 1 to 64 letters, digits, - and _, beginning with a letter or digit")
    if name in RESERVED:
        raise KeyNameError(f"{name!r} is reserved, like {sorted(RESERVED - {name})}; choose another name")
    return name


def image(sensor: str, stream: str) -> str:
    """Topic of a stream's images."""
    return f"{sensor}/{stream}/image"


def info(image_topic: str) -> str:
    """Topic of a recording with the attachments of `image_topic`."""
    return image_topic.removesuffix("image") + "info"


def points(image_topic: str) -> str:
    """Topic of the foxglove.PointCloud of a stream's depth images."""
    return image_topic.removesuffix("image") + "points"


def calibration(sensor: str) -> str:
    """Topic of a sensor's foxglove.CameraCalibration."""
    return f"{sensor}/calibration"


def model(sensor: str) -> str:
    """Topic of a sensor's absmsg.v1.SensorModel."""
    return f"{sensor}/model"


def truth(device: str) -> str:
    """Topic of the ground truth of a simulated device."""
    return f"{device}/truth"


def state(tracker: str) -> str:
    """Topic of a tracker's estimates."""
    return f"{tracker}/state"


def mesh(tracker: str) -> str:
    """Topic of a tracker's deformed vertices."""
    return f"{tracker}/mesh"


def theta(tracker: str) -> str:
    """Topic of a tracker's estimates for slow links: absmsg.v1.CompactState."""
    return f"{tracker}/theta"


def scene(tracker: str) -> str:
    """Topic of a tracker's mesh as a foxglove.SceneUpdate."""
    return f"{tracker}/scene"


def topology(tracker: str) -> str:
    """Topic of a tracker's mesh topology."""
    return f"{tracker}/topology"


def reinitialize(tracker: str) -> str:
    """Topic of commands to detect a tracker's object anew: queries with an absmsg.v1.Reinitialize."""
    return f"{tracker}/reinitialize"


def controls(device: str) -> str:
    """Topic of commands to set a device's controls: queries with an absmsg.v1.SetControls."""
    return f"{device}/controls"


def health(component: str) -> str:
    """Topic of a component's health: capture, record, run, track/<tracker>."""
    return f"health/{component}"


def clock(host_clock: str) -> str:
    """Topic at which the host of a clock, see `drivers.contract.host_clock`, answers queries for its time."""
    return f"clock/{host_clock}"


def live(component: str) -> str:
    """Topic of a component's liveliness token."""
    return f"live/{component}"


def is_image(topic: str) -> bool:
    """True if the messages of a topic are images, whose attachments describe them."""
    return topic.count("/") == 2 and topic.endswith("/image")


def key(rig: str, topic: str) -> str:
    """The zenoh key of a topic of `rig`; `topic` may be an expression such as `**`."""
    return f"{ROOT}/{rig}/{topic}"


def topic(rig: str, key: str) -> str:
    """The topic of a key of `rig`; inverse of `key`.

    Raises:
        KeyNameError: the key belongs to another rig.
    """
    prefix = f"{ROOT}/{rig}/"
    if not key.startswith(prefix) or len(key) == len(prefix):
        raise KeyNameError(f"{key!r} is no key of rig {rig!r}, those begin with {prefix!r}")
    return key[len(prefix) :]
