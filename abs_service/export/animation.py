"""Estimates as a moving mesh in one file: binary glTF with a morph target for each pose."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.api.estimate import Estimate
from abs_service.display.page.scene.gltf import INDICES, VERTICES, Buffer
from abs_service.export.arrays import mesh_numbers
from abs_service.export.errors import ExportError

#: Largest number of poses. Weights of all of them are stored for each one, and programs slow down with many.
POSES = 240

#: Half a turn about x: from y down and z forward to glTF's y up and z to the viewer.
_HALF_TURN = [1.0, 0.0, 0.0, 0.0]


def write(estimates: Iterable[Estimate], path: Path) -> int:
    """Writes a GLB file [m, s] and returns its number of poses: of n times as many as `POSES`, each n-th is kept.

    Each mesh is a node with an animated weight for each of its poses; of several meshes the others have scale 0.

    Raises:
        ExportError: no estimate has a mesh.
        OSError: the file cannot be written.
    """
    poses = _thinned(one for one in estimates if len(one.vertices))
    if not poses:
        raise ExportError("no estimate has a mesh, so there is nothing to animate")
    buffer = Buffer()
    numbers = np.array(mesh_numbers(poses))
    times = buffer.add(np.array([one.time_s - poses[0].time_s for one in poses], np.float32))
    meshes: list[dict[str, Any]] = []
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for number in range(numbers[-1] + 1):
        (own,) = np.nonzero(numbers == number)
        meshes.append(_mesh(buffer, [poses[k] for k in own]))
        for name, values, between in (
            ("weights", _weights(own, len(poses)).ravel(), "LINEAR"),
            ("scale", np.repeat((numbers == number)[:, None], 3, axis=1), "STEP"),
        ):
            channels.append({"sampler": len(samplers), "target": {"node": number + 1, "path": name}})
            output = buffer.add(values.astype(np.float32))
            samplers.append({"input": times, "output": output, "interpolation": between})
    count = len(meshes)
    document = {
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"name": "rig", "rotation": _HALF_TURN, "children": list(range(1, count + 1))},
            *({"name": f"mesh {number}", "mesh": number} for number in range(count)),
        ],
        "meshes": meshes,
        "animations": [{"name": "estimates", "samplers": samplers, "channels": channels}],
    }
    path.write_bytes(buffer.file(document))
    return len(poses)


def _thinned(estimates: Iterable[Estimate]) -> list[Estimate]:
    """Every n-th estimate, as many as allowed, at times that grow."""
    kept: list[Estimate] = []
    step, seen = 1, 0
    for one in estimates:
        if kept and np.float32(one.time_s - kept[0].time_s) <= np.float32(kept[-1].time_s - kept[0].time_s):
            continue
        if seen % step == 0:
            kept.append(one)
        seen += 1
        if len(kept) > POSES:
            kept, step = kept[::2], 2 * step
    return kept


def _mesh(buffer: Buffer, poses: list[Estimate]) -> dict[str, Any]:
    """The first pose, with the way from it to each pose as a target."""
    first = poses[0]
    targets = [{"POSITION": buffer.add(one.vertices - first.vertices, VERTICES)} for one in poses]
    return {
        "primitives": [
            {
                "attributes": {"POSITION": buffer.add(first.vertices, VERTICES)},
                "indices": buffer.add(first.faces.ravel().astype(np.uint32), INDICES),
                "material": 0,
                "targets": targets,
            }
        ],
        "weights": [1.0] + [0.0] * (len(poses) - 1),
    }


def _weights(own: NDArray[np.intp], count: int) -> NDArray[np.float64]:
    """Weights (count, targets) of a mesh with the poses `own`: 1 for the own pose that is nearest in time."""
    return np.eye(len(own))[np.clip(np.arange(count) - own[0], 0, len(own) - 1)]
