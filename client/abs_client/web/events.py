"""Estimates as server-sent events, the format of HTML's `EventSource`."""

import base64
import json
import math
from collections.abc import Iterable, Iterator

from abs_client.estimates.state import State


def events(states: Iterable[State]) -> Iterator[bytes]:
    """An event `state` for each estimate, and before the first one of each mesh an event `topology`.

    Vertices, float32, and faces and undeformed vertices, uint32 and float32, are little-endian in base64.
    """
    known: tuple[str, int] | None = None
    for state in states:
        mesh = state.topology.header.boot_id, state.topology.mesh_version
        if mesh != known and len(state.faces):
            known = mesh
            yield _event("topology", _topology(state))
        yield _event("state", _state(state))


def _event(name: str, content: dict[str, object]) -> bytes:
    return f"event: {name}\ndata: {json.dumps(content, allow_nan=False)}\n\n".encode()


def _topology(state: State) -> dict[str, object]:
    return {
        "mesh_version": state.mesh_version,
        "faces": _base64(state.topology.faces_u32),
        "undeformed": _base64(state.topology.rest_vertices_f32),
    }


def _state(state: State) -> dict[str, object]:
    return {
        "seq": state.seq,
        "t_host_ns": str(state.t_host_ns),  # beyond what a number of JavaScript holds
        "status": state.status.value,
        "reasons": state.reasons,
        "age_s": _number(state.age_s),
        "mesh_version": state.mesh_version,
        "model_id": state.message.model_id,
        "theta": state.theta.tolist(),
        "shares": {name: _number(share) for name, share in state.shares.items()},
        "vertices": _base64(state.mesh.vertices_f32),
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None  # JSON has no NaN


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
