"""Estimates as arrays."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.api.estimate import Estimate


def write(estimates: Iterable[Estimate], path: Path) -> int:
    """Writes an NPZ file and returns its number of estimates n.

    Its arrays: `times` (n,) [s], `status` (n,), `mesh` (n,), `theta` (n, dim), `covariance` (n, dim, dim) of theta,
    `vertices` (n, vertices, 3) [m], `vertex_covariance` (n, vertices, 3, 3) [m²]; NaN where there is no value, as
    beyond the end of a smaller mesh. `faces_M` and `undeformed_M` are those of mesh M; -1 in `mesh` is none.

    Raises:
        OSError: the file cannot be written.
    """
    kept = list(estimates)
    mesh = mesh_numbers(kept)
    parts: dict[str, Any] = {f"faces_{m}": kept[mesh.index(m)].faces for m in set(mesh) - {-1}}
    parts |= {f"undeformed_{m}": kept[mesh.index(m)].undeformed for m in set(mesh) - {-1}}
    with path.open("wb") as stream:
        np.savez(
            stream,
            allow_pickle=False,
            times=np.array([one.time_s for one in kept]),
            status=np.array([one.status.value for one in kept], "U12"),
            mesh=np.array(mesh, np.int32),
            theta=_stacked([one.theta for one in kept], 1),
            covariance=_stacked([one.covariance for one in kept], 2),
            vertices=_stacked([one.vertices for one in kept], 1),
            vertex_covariance=_stacked([one.vertex_covariance.astype(np.float32) for one in kept], 1),
            **parts,
        )
    return len(kept)


def mesh_numbers(kept: Sequence[Estimate]) -> list[int]:
    """Number of each estimate's mesh, counted from 0; a tracker that starts again counts its versions anew."""
    found, last = [], -1
    before: Estimate | None = None
    for one in kept:
        if len(one.vertices) and (before is None or not _same(before, one)):
            last += 1
        before = one if len(one.vertices) else before
        found.append(last if len(one.vertices) else -1)
    return found


def _same(a: Estimate, b: Estimate) -> bool:
    return np.array_equal(a.faces, b.faces) and np.array_equal(a.undeformed, b.undeformed)


def _stacked(arrays: list[NDArray[Any]], growing: int) -> NDArray[Any]:
    """Arrays in one, NaN beyond the end of the smaller ones in their first `growing` axes."""
    if not arrays:
        return np.zeros(0)
    shape = np.max([one.shape for one in arrays], axis=0)
    stack = np.full((len(arrays), *shape), np.nan, arrays[0].dtype)
    for place, one in zip(stack, arrays):
        place[tuple(slice(size) for size in one.shape[:growing])] = one
    return stack
