"""Keys, liveliness tokens and attachments of rmw_zenoh, as its releases from 0.2.4 on write and read them.

Source: `design.md`, `liveliness_utils.cpp` and `attachment_helpers.cpp` of ros2/rmw_zenoh, branch jazzy.
"""

import re
import struct
from dataclasses import dataclass

import xxhash

#: Bytes of the identity of a publisher.
GID_SIZE = 16

_ATTACHMENT = struct.Struct(f"<qqB{GID_SIZE}s")
_TYPE = re.compile(r"(\w+)/msg/(\w+)")
_NO_NAME = re.compile(r"[^A-Za-z0-9_]")
#: Enclave and namespace of a node that has none.
_NONE = "%"


@dataclass(frozen=True)
class Qos:
    """Quality of service of a topic; reliable, and the newest messages are kept.

    Attributes:
        depth: messages kept; not 42, which the layout would leave out as its default.
        transient_local: a late subscription gets these messages.
    """

    depth: int = 10
    transient_local: bool = False

    def text(self) -> str:
        """Part of a token that states this quality: what differs from the defaults, see `qos_to_keyexpr`."""
        return f":{'1' if self.transient_local else ''}:,{self.depth}:,:,:,,"


@dataclass(frozen=True)
class Node:
    """A node as the ROS graph knows it, without enclave and namespace.

    Attributes:
        domain: `ROS_DOMAIN_ID`.
        session: zenoh's identity of the session, as zenoh prints it.
        name: of the node.
    """

    domain: int
    session: str
    name: str

    def token(self) -> str:
        """Liveliness token of the node, which is the first entity of its session."""
        return f"@ros2_lv/{self.domain}/{self.session}/0/0/NN/{_NONE}/{_NONE}/{self.name}"

    def publisher_token(self, number: int, topic: str, message: str, type_hash: str, qos: Qos) -> str:
        """Liveliness token of a publisher.

        Args:
            number: of the entity in its session, 1 or more.
            topic: `/rig/sensor`.
            message: `sensor_msgs/msg/Image`.
            type_hash: `RIHS01_…`.
            qos: of the topic.
        """
        entity = f"@ros2_lv/{self.domain}/{self.session}/0/{number}/MP/{_NONE}/{_NONE}/{self.name}"
        return f"{entity}/{topic.replace('/', '%')}/{dds_type(message)}/{type_hash}/{qos.text()}"

    def key(self, topic: str, message: str, type_hash: str) -> str:
        """The key that the messages of a topic have; arguments as in `publisher_token`."""
        return f"{self.domain}/{topic.strip('/')}/{dds_type(message)}/{type_hash}"


def dds_type(message: str) -> str:
    """Name of a type in keys: `sensor_msgs::msg::dds_::Image_` for `sensor_msgs/msg/Image`."""
    return _TYPE.sub(r"\1::msg::dds_::\2_", message)


def gid(token: str) -> bytes:
    """Identity of a publisher: the hash of its token, low half first, each half little-endian."""
    return xxhash.xxh3_128_digest(token.encode())[::-1]


def attachment(sequence_number: int, time_ns: int, identity: bytes) -> bytes:
    """The bytes that travel beside a message.

    Args:
        sequence_number: of the message, the first has 1.
        time_ns: of its publication, since 1970 [ns].
        identity: of the publisher, see `gid`.
    """
    return _ATTACHMENT.pack(sequence_number, time_ns, GID_SIZE, identity)


def ros_name(name: str) -> str:
    """A rig's, sensor's or tracker's name as ROS allows it: `_` for what is no letter or digit, no digit first."""
    allowed = _NO_NAME.sub("_", name)
    return f"n{allowed}" if allowed[0].isdigit() else allowed
