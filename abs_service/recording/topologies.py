"""Finds estimates whose mesh is not recorded: its topology is sent once, and may be lost on the way."""

from collections.abc import Sequence

from abs_service.bus.contract import Sample
from abs_service.wire.estimate_messages import MESH
from abs_service.wire.message_header import TOPOLOGY, MessageHeader


class Topologies:
    """Compares the meshes of the estimates with the topologies that came."""

    def __init__(self) -> None:
        # By tracker: the process and the number of the mesh. A process that is started again counts anew.
        self._used: dict[str, tuple[str, int]] = {}
        self._known: dict[str, tuple[str, int]] = {}
        self._looked_at: set[str] = set()

    def add(self, sample: Sample, about: MessageHeader) -> None:
        """Takes a message of any type."""
        if about.mesh_version and sample.message in (MESH, TOPOLOGY):
            found = self._used if sample.message == MESH else self._known
            found[sample.topic.partition("/")[0]] = about.publisher, about.mesh_version

    def missing(self) -> Sequence[str]:
        """Trackers whose topology is missing, and was when this was called before: another one may be on its way."""
        now = {tracker for tracker, mesh in self._used.copy().items() if mesh != self._known.get(tracker)}
        before, self._looked_at = self._looked_at, now
        return sorted(before & now)
