"""Handlers of a tracker's messages: of whole estimates, or of theta alone for a slow link."""

from collections.abc import Callable, Mapping

from abs_client.connection.received import Received
from abs_client.estimates import reading
from abs_client.estimates.assembly import Assembly
from abs_client.estimates.expansion import Expansion

#: What is done with the messages of each topic of a tracker; `topology` is one of them.
Handlers = Mapping[str, Callable[[Received], None]]
#: Makes the handlers that complete estimates in an assembly.
Feed = Callable[[Assembly], Handlers]


def whole(assembly: Assembly) -> Handlers:
    """Estimates with covariances and vertices, as they are published: tens of kilobytes each."""
    return {
        "topology": lambda one: assembly.add_topology(reading.topology(one)),
        "state": lambda one: assembly.add_state(reading.state(one)),
        "mesh": lambda one: assembly.add_mesh(reading.mesh(one)),
    }


def compact(assembly: Assembly) -> Handlers:
    """Theta and status, hundreds of bytes each; vertices are computed here, covariances unknown."""
    expansion = Expansion(assembly)
    return {
        "topology": lambda one: expansion.add_topology(reading.topology(one)),
        "theta": lambda one: expansion.add_compact(reading.compact(one)),
    }
