"""Known objects from files with triangle meshes."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.plausibility import MAX_M, MIN_M
from abs_service.tracker.detection.shapes.paint import NO_PAINT, PointPaint
from abs_service.tracker.detection.shapes.principal_axes import extents, principal_axes
from abs_service.tracker.detection.shapes.resampling import evenly_spread, triangulated
from abs_service.tracker.detection.shapes.samples import Samples
from abs_service.tracker.detection.templates.known_object import KnownObject
from abs_service.tracker.mesh import Mesh, edge_lengths, sides_of
from drivers.contract.errors import install_extra

#: Formats that are read, by the ending of the name.
FORMATS = (".obj", ".ply", ".stl")

#: Number of sample points for the registration; more are slower and not more accurate. And of points with colours.
SAMPLES, PAINTED = 1500, 10_000

#: Ratios of the file's number of vertices to the requested one between which the file's are kept.
MIN_RATIO, MAX_RATIO = 0.5, 2.0

#: Longest edge of divided faces, as a share of the distance between vertices, and largest number of vertices for that.
FINENESS, MAX_VERTICES = 0.7, 50_000

#: Vertices this near to each other, as a share of the object's size, are one: of another face, or with another texture.
SAME = 1e-6

Colors = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class _Content:
    """Content of a file.

    Attributes:
        vertices: rows (n, 3 + k): positions, then what the colours depend on, such as texture coordinates.
        faces: vertex indices (m, 3).
        colors: red, green, blue (n, 3) in 0…255 from the other k columns of such rows; NaN if the file has none.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    colors: Colors


def load(path: Path, metres: float, vertices: int) -> KnownObject:
    """The object in an OBJ, PLY or STL file, whose unit is so many metres, with about so many vertices.

    Raises:
        DetectionError: the file is missing, or no mesh that can be tracked; names the key and the allowed values.
    """
    content = _read(path)
    given = _checked(_mesh(content, metres), path)
    is_painted = bool(np.isfinite(given.colors).all())
    spacing = np.sqrt(given.area / max(vertices, PAINTED if is_painted else SAMPLES))
    dense = _mesh(_divided(content, FINENESS * spacing / metres), metres)
    chosen = evenly_spread(dense, SAMPLES)
    samples = Samples(dense.vertices[chosen], dense.normals[chosen], dense.area, _is_closed(given))
    paint = PointPaint(dense.vertices, dense.normals, dense.colors.astype(np.float64)) if is_painted else NO_PAINT
    if MIN_RATIO * vertices <= len(given.vertices) <= MAX_RATIO * vertices:
        return KnownObject(given, samples, paint)
    kept, faces = triangulated(dense, evenly_spread(dense, vertices))
    coarse = replace(dense, vertices=dense.vertices[kept], faces=faces, colors=dense.colors[kept])
    return KnownObject(replace(coarse, chart=dense.chart[kept]), samples, paint)


def _read(path: Path) -> _Content:
    if path.suffix.lower() not in FORMATS:
        raise DetectionError(f"path = {str(path)!r}: the name must end in {', '.join(FORMATS)}")
    if not path.is_file():
        raise DetectionError(f"path = {str(path)!r}: there is no such file")
    try:
        trimesh = import_module("trimesh")
    except ImportError:
        needed = f'template type "mesh" needs a library: {install_extra("mesh")} in the clone'
        raise DetectionError(needed) from None
    try:
        found = trimesh.load_mesh(path, process=False)
    except Exception as error:  # each of its readers has errors of its own
        raise DetectionError(f"path = {str(path)!r} cannot be read: {error}") from error
    vertices, faces = np.asarray(getattr(found, "vertices", ())), np.asarray(getattr(found, "faces", ()))
    if not len(faces):
        raise DetectionError(f"path = {str(path)!r} has no triangles; a surface is needed, not points")
    return _with_colors(found.visual, vertices.astype(np.float64), faces.astype(np.int32))


def _with_colors(visual: Any, vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> _Content:
    """Content with the colours that the library's `visual` describes: a texture, colours, or none."""
    match visual.kind:
        case "texture" if visual.uv is not None:
            return _Content(
                np.hstack([vertices, visual.uv]),
                faces,
                lambda rows: np.asarray(visual.material.to_color(rows), np.float64)[:, :3],
            )
        case "vertex" | "face":
            colors = np.asarray(visual.vertex_colors, np.float64)[:, :3]
            return _Content(np.hstack([vertices, colors]), faces, lambda rows: rows)
    return _Content(vertices, faces, lambda rows: np.full((len(rows), 3), np.nan))


def _divided(content: _Content, maximum: float) -> _Content:
    """The same surface with every face divided into four until no edge is longer."""
    subdivide = import_module("trimesh.remesh").subdivide
    vertices, faces = content.vertices, content.faces
    while len(vertices) < MAX_VERTICES:
        if edge_lengths(vertices[:, :3], sides_of(faces)).max() <= maximum:
            break
        vertices, faces = subdivide(vertices, faces)[:2]
    return replace(content, vertices=vertices, faces=faces)


def _mesh(content: _Content, metres: float) -> Mesh:
    """The mesh around its centre [m], every vertex once; its chart is the plane of its principal axes."""
    places, colors = content.vertices[:, :3] * metres, content.colors(content.vertices[:, 3:])
    size = max(float(np.ptp(places, axis=0).max()), 1e-12)
    cell = np.round((places - places.min(axis=0)) / (SAME * size)).astype(np.int64)
    first, place = np.unique(cell, axis=0, return_index=True, return_inverse=True)[1:]
    place = place.reshape(-1)
    count = np.bincount(place).astype(np.float64)
    mean = np.stack([np.bincount(place, colors[:, c]) / count for c in range(3)], axis=1).astype(np.float32)
    faces = place[content.faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    positions = places[first[used]]
    center, axes = principal_axes(positions) if len(used) > 3 else (positions.mean(axis=0), np.eye(3))
    chart = (positions - center) @ axes[:, :2]
    return Mesh(positions - center, faces.reshape(-1, 3).astype(np.int32), mean[used], chart, is_complete=True)


def _checked(mesh: Mesh, path: Path) -> Mesh:
    """The mesh, or DetectionError if it cannot be tracked."""
    if len(mesh.vertices) < 3 or not mesh.area > 0:
        raise DetectionError(f"path = {str(path)!r} has no triangles with an area; a surface is needed")
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    if not MIN_M <= size <= MAX_M:
        raise DetectionError(
            f"path = {str(path)!r}: the object would measure {extents(mesh.vertices)}, {MIN_M:g} m to "
            f'{MAX_M:g} m allowed; unit = "m", "cm" or "mm" says what its coordinates are'
        )
    directed = sides_of(mesh.faces).astype(np.int64) @ [len(mesh.vertices), 1]
    if len(np.unique(directed)) < len(directed):
        raise DetectionError(
            f"path = {str(path)!r}: neighbouring faces are oriented against each other, or more than two share an "
            "edge; all must be counter-clockwise seen from outside"
        )
    return mesh


def _is_closed(mesh: Mesh) -> bool:
    """True if every edge has a face on both sides."""
    return 2 * len(mesh.edges) == 3 * len(mesh.faces)
