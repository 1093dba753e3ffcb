"""A connection to a router, in zenoh's configuration."""

import socket
import threading
from collections.abc import Mapping

#: A peer without a keep-alive for this long is disconnected [ms].
LEASE_MS = 2000
#: Time between the tries to connect again to a router that is gone: at first, and at most [ms].
RETRY: Mapping[str, int] = {"period_init_ms": 250, "period_max_ms": 1000}
#: Longest time of a try [ms]. One that begins while the network is cut would, by default, wait for 10 s: TCP repeats
#: its question after 1, 3, 7 s and so notices late that the network is back.
UNICAST: Mapping[str, int] = {"open_timeout": 2000}
#: Batches of 64 kB that may wait for a socket: the most that zenoh has, so that an image finds room while its reader
#: waits for a processor. Beside six busy processes on two cores, 7 instead of 30 % of 1800 images were lost.
#: An estimate takes a batch for itself: of 900 in bursts of three, none was lost instead of 58 and 121.
QUEUE: Mapping[str, Mapping[str, int]] = {"size": {"real_time": 16, "data_high": 16, "data": 16, "data_low": 16}}
#: Levels of zenoh's log. What is off warns at each message that its sender's wall clock is ahead, as another host's is,
#: or that one's own was set back. Only caches need these times, and zenoh mends those.
LOG_LEVELS = "error,zenoh::net::routing::dispatcher::pubsub=off"

#: Time that a name server has to answer [s].
RESOLVE_S = 0.5


def unresolved(endpoint: str) -> str:
    """Says that the host of an endpoint, such as tcp/lab4:7447, has no address; "" if it has one."""
    host = endpoint.partition("/")[2].rpartition(":")[0].strip("[]")
    reason = ["no name server answers"]

    def resolve() -> None:
        try:
            socket.getaddrinfo(host, None)
            reason.append("")
        except OSError as error:
            reason.append(str(error.strerror))
        except UnicodeError:
            reason.append("no name may have an empty part, or one of more than 63 letters")

    thread = threading.Thread(target=resolve, name="resolve", daemon=True)
    thread.start()
    thread.join(RESOLVE_S)
    return reason[-1] and f'the name "{host}" cannot be resolved: {reason[-1]}; correct it, or write its address'
