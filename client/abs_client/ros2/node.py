"""A node of the ROS graph: its session with the router of the ROS system, tokens and publishers."""

import threading
from collections.abc import Callable
from time import time_ns
from typing import Any, Self

import zenoh
from zenoh import ext

from abs_client.connection.session import opened
from abs_client.ros2 import cdr, layout
from abs_client.ros2.layout import Qos

#: Period in which the last number of a topic that is kept is repeated, as rmw_zenoh does [s].
HEARTBEAT_S = 0.5


class RosNode:
    """A node that only publishes. A topic is declared with its first message.

    Args:
        router: endpoint of rmw_zenoh's router.
        name: of the node.
        domain: `ROS_DOMAIN_ID`.
        clock: wall-clock time [ns].

    Raises:
        UnreachableError: nothing answers there.
    """

    def __init__(self, router: str, name: str, domain: int, clock: Callable[[], int] = time_ns) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._publishers: dict[str, _Publisher] = {}
        self._session = opened(router)
        self._node = layout.Node(domain, str(self._session.info.zid()), name)
        self._token = self._session.liveliness().declare_token(self._node.token())

    @property
    def published(self) -> dict[str, int]:
        """Messages so far, by topic."""
        with self._lock:
            return {topic: publisher.sent for topic, publisher in self._publishers.items()}

    def publish(self, topic: str, name: str, message: Callable[[], Any], qos: Qos = Qos()) -> None:  # noqa: B008 frozen
        """Publishes if there is a subscription, or a later one gets it; otherwise the message is not even made.

        Args:
            topic: `/rig/sensor`.
            name: of the message's type, `sensor_msgs/msg/Image`.
            message: makes it.
            qos: of the topic, equal in every call.
        """
        try:
            publisher = self._publisher(topic, name, qos)
            if qos.transient_local or publisher.is_wanted():
                publisher.put(cdr.serialized(message()), self._clock())
        except zenoh.ZError:
            if not self._session.is_closed():  # what is on its way at the end is nobody's any more
                raise

    def close(self) -> None:
        """Leaves the graph."""
        self._session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _publisher(self, topic: str, name: str, qos: Qos) -> "_Publisher":
        with self._lock:
            if topic not in self._publishers:
                self._publishers[topic] = self._declare(topic, name, qos)
            return self._publishers[topic]

    def _declare(self, topic: str, name: str, qos: Qos) -> "_Publisher":
        type_hash = cdr.type_hash(name)
        token = self._node.publisher_token(len(self._publishers) + 1, topic, name, type_hash, qos)
        key, drop = self._node.key(topic, name, type_hash), zenoh.CongestionControl.DROP
        # As rmw_zenoh declares a publisher that is reliable and keeps the last messages.
        if qos.transient_local:
            declared: Any = ext.declare_advanced_publisher(
                self._session,
                key,
                congestion_control=drop,
                cache=ext.CacheConfig(qos.depth),
                sample_miss_detection=ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=HEARTBEAT_S),
                publisher_detection=True,
            )
        else:
            declared = self._session.declare_publisher(key, congestion_control=drop)
        return _Publisher(declared, self._session.liveliness().declare_token(token), layout.gid(token))


class _Publisher:
    def __init__(self, declared: Any, token: zenoh.LivelinessToken, identity: bytes) -> None:
        self._declared = declared
        self._token = token  # ends when it is collected
        self._identity = identity
        self._lock = threading.Lock()
        self.sent = 0

    def is_wanted(self) -> bool:
        return self._declared.matching_status.matching

    def put(self, payload: bytes, time_ns: int) -> None:
        with self._lock:
            self.sent += 1
            self._declared.put(payload, attachment=layout.attachment(self.sent, time_ns, self._identity))
