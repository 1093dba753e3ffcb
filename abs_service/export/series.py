"""Estimates as a series of meshes, one file each, as OBJ or PLY."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from abs_service.api.estimate import Estimate
from abs_service.export.errors import ExportError
from calib.files import atomic

_PLY = """ply
format binary_little_endian 1.0
comment metres; sigma: standard deviation of the position
element vertex {vertices}
property float x
property float y
property float z
property float sigma
element face {faces}
property list uchar int vertex_indices
end_header
"""


def write(estimates: Iterable[Estimate], path: Path) -> int:
    """Writes FOLDER/NAME_000000.SUFFIX, … for a path FOLDER/NAME.SUFFIX, and returns the number of estimates.

    A file's number is that of the estimate, so a number is missing where there is no mesh. Vertices are in metres.

    Raises:
        ExportError: such files are there already, or a file where their folder should be.
        OSError: the folder or a file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise ExportError(f"--out {path}: {error.filename} is no folder") from None
    if there := sorted(path.parent.glob(f"{path.stem}_[0-9]*{path.suffix}")):
        raise ExportError(f"{there[0]} is there already; name another folder with --out")
    number = 0
    for number, one in enumerate(estimates, start=1):
        if len(one.vertices):
            content = _obj(one) if path.suffix == ".obj" else _ply(one)
            atomic.write(path.with_name(f"{path.stem}_{number - 1:06d}{path.suffix}"), content)
    return number


def _obj(estimate: Estimate) -> bytes:
    vertices = "".join(f"v {x:.7g} {y:.7g} {z:.7g}\n" for x, y, z in estimate.vertices.tolist())
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in (estimate.faces + 1).tolist())
    return f"{vertices}{faces}".encode()


def _ply(estimate: Estimate) -> bytes:
    sigma = np.sqrt(np.trace(estimate.vertex_covariance, axis1=1, axis2=2))
    vertices = np.column_stack([estimate.vertices, sigma]).astype("<f4")
    faces = np.zeros(len(estimate.faces), [("count", "u1"), ("vertices", "<i4", 3)])
    faces["count"], faces["vertices"] = 3, estimate.faces
    header = _PLY.format(vertices=len(vertices), faces=len(faces))
    return header.encode() + vertices.tobytes() + faces.tobytes()
