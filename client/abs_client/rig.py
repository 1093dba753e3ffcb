"""A running rig: its estimates, images and calibrations, and commands to it."""

from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Any, Self

import numpy as np
from absmsg.v1.command_pb2 import CommandAnswer, Record, Reinitialize, SetControls
from absmsg.v1.common_pb2 import Header
from absmsg.v1.sensor_model_pb2 import SensorModel

from abs_client import images
from abs_client.camera import Camera, camera
from abs_client.connection.link import DEFAULT_ENDPOINT, Link, checked
from abs_client.connection.received import decoded
from abs_client.connection.tls import Tls
from abs_client.errors import ClientError, RangeError
from abs_client.estimates import feeds, states
from abs_client.estimates.state import State
from abs_client.images import Image
from abs_client.stream import NothingReceivedError, Stream

#: Estimates that are older are left out [s].
MAX_AGE_S = 0.5

#: Fields of a control's value and what they hold, by its type, also of NumPy.
_FIELDS = (
    ((bool, np.bool_), "on", bool),
    (Integral, "whole", int),
    ((float, np.floating), "number", float),
    (str, "choice", str),
)


class RefusedError(ClientError):
    """A command was refused, with the reason."""


def subscribe(
    endpoint: str = DEFAULT_ENDPOINT,
    rig: str = "demo",
    tracker: str = "sheet",
    maximum_age_s: float = MAX_AGE_S,
    tls: Tls | None = None,
) -> Stream[State]:
    """The estimates of a tracker for `for` or `async for`: always the newest, and what belongs together.

    A reader that is slow gets fewer, not older ones. When no estimate younger than `maximum_age_s` came for so long, it
    gets a STALE state, again after every `maximum_age_s`, until there are new ones. Connecting may take some seconds.

    Args:
        endpoint: `bus.endpoint` of the rig.
        rig, tracker: their names.
        maximum_age_s: age beyond which an estimate is not given [s]; infinite: all are given, silence is not reported.
        tls: for a rig with `[bus.tls]`.

    Raises:
        UnknownNameError: `endpoint`, `rig` or `tracker` cannot be one.
        RangeError: `maximum_age_s` is not greater than 0.
        UnreachableError: nothing answers at `endpoint`.
    """
    checked(tracker)
    states.checked_age(maximum_age_s)
    link = Link(endpoint, rig, tls)
    return states.states(link, tracker, maximum_age_s, link.close)


class Rig:
    """A connection to a rig, for several trackers, images, calibrations and commands.

    Args:
        endpoint, rig, tls: see `subscribe`, errors too.
    """

    def __init__(self, endpoint: str = DEFAULT_ENDPOINT, rig: str = "demo", tls: Tls | None = None) -> None:
        self._link = Link(endpoint, rig, tls)

    @property
    def malformed(self) -> Mapping[str, int]:
        """Messages so far that could not be read, by key; they are left out."""
        return dict(self._link.malformed)

    def states(self, tracker: str, maximum_age_s: float = MAX_AGE_S) -> Stream[State]:
        """The estimates of a tracker, see `subscribe`."""
        return states.states(self._link, checked(tracker), maximum_age_s)

    def compact_states(self, tracker: str, maximum_age_s: float = MAX_AGE_S) -> Stream[State]:
        """The same over a slow link: only theta and status are sent, some hundred bytes for each estimate.

        Vertices are computed here, from a basis that is sent once for each mesh. Covariances and shares are unknown.
        Models without a basis, all but `nurbs`, have no vertices.
        """
        return states.states(self._link, checked(tracker), maximum_age_s, feed=feeds.compact)

    def images(self, sensor: str, stream: str) -> Stream[Image]:
        """The images of a sensor's stream, for `for` or `async for`: always the newest."""
        return images.images(self._link, checked(sensor), checked(stream))

    def image(self, sensor: str, stream: str, timeout_s: float = 2.0) -> Image:
        """The next image of a sensor's stream.

        Raises:
            NothingReceivedError: there was none within `timeout_s`.
        """
        with self.images(sensor, stream) as newest:
            return newest.next(timeout_s)

    def camera(self, sensor: str) -> Camera:
        """Calibration of a sensor.

        Raises:
            NothingReceivedError: nobody tells it.
            MalformedError: the answer cannot be read.
        """
        for answer in self._link.query(f"{checked(sensor)}/model"):
            return camera(decoded(SensorModel, answer))
        raise NothingReceivedError(f"nobody tells the calibration of sensor {sensor!r}")

    def processes(self) -> tuple[str, ...]:
        """The processes of the rig that live: `run`, `capture`, `record`, `track/<tracker>`."""
        prefix = self._link.key("live/")
        return tuple(sorted(key.removeprefix(prefix) for key in self._link.tokens("live/**")))

    def reinitialize(
        self, tracker: str, seed: tuple[int, int] | None = None, polygon: Sequence[tuple[int, int]] = ()
    ) -> str:
        """Has a tracker detect its object anew.

        Args:
            tracker: its name.
            seed: a pixel (column, row) of the object in the depth image of the tracker's reference sensor; None: what
                the region of the rig file says.
            polygon: in place of a seed, the corners (column, row), three or more, of a polygon around the object.

        Returns:
            The lines of the rig file that make a seed or a polygon last; "" without them.

        Raises:
            RefusedError: the tracker refuses.
            NothingReceivedError: there is no answer, as where this program's certificate does not allow the command.
            MalformedError: the answer cannot be read; the tracker may have done it.
        """
        command = Reinitialize(header=self._header(), tracker=checked(tracker))
        if seed is not None:
            command.seed.column, command.seed.row = seed
            command.seed.SetInParent()  # a pixel (0, 0) is one, too
        for column, row in polygon:
            command.polygon.add(column=column, row=row)
        return self._command(f"{tracker}/reinitialize", command).region

    def record(self, recording: bool) -> None:
        """Has the rig record, or wait; needs `record.when` in its file. Raises as `reinitialize`."""
        self._command("record", Record(header=self._header(), recording=recording))

    def controls(
        self, device: str, values: Mapping[str, bool | int | float | str] | None = None
    ) -> dict[str, bool | int | float | str]:
        """Sets controls of a device, such as exposure times, until `capture` starts again.

        Args:
            device: its name.
            values: by control; None: nothing is set.

        Returns:
            All controls of the device, as they are then. Raises as `reinitialize`.

        Raises:
            RangeError: a value of another type.
        """
        command = SetControls(header=self._header(), device=checked(device))
        for name, value in (values or {}).items():
            command.controls.add(name=name, **_field(name, value))
        answer = self._command(f"{device}/controls", command)
        return {one.name: getattr(one, field) for one in answer.controls if (field := one.WhichOneof("value"))}

    def close(self) -> None:
        """Ends the connection and all streams on it; may be called again."""
        self._link.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _header(self) -> Header:
        return Header(rig=self._link.rig)

    def _command(self, topic: str, command: Reinitialize | Record | SetControls) -> CommandAnswer:
        for one in self._link.query(topic, command.SerializeToString(), command.DESCRIPTOR.full_name):
            answer = decoded(CommandAnswer, one)
            if not answer.accepted:
                raise RefusedError(answer.reason)
            return answer
        raise NothingReceivedError(f"nobody answers on {topic}")


def _field(name: str, value: Any) -> dict[str, Any]:
    """The field of a control's value in its message."""
    for kind, field, made in _FIELDS:
        if isinstance(value, kind):
            return {field: made(value)}
    raise RangeError(f"{name} = {value!r}: must be true or false, a number or a text")
