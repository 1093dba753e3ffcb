"""Meshes as binary glTF 2.0: the live page's own meshes have one colour each."""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import edges_of

#: Values of the format: component types, kinds of buffer and primitive, and the marks of file and chunks.
COMPONENTS = {"f4": 5126, "u4": 5125, "u1": 5121}
VERTICES, INDICES, LINES = 34962, 34963, 1
MAGIC, JSON, BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942

#: Brightness of an edge, as a share of the surface's in linear light.
EDGE = 0.3

#: Dull, and seen from both sides.
MATERIAL = {"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9}, "doubleSided": True}


class Buffer:
    """The binary part of a file."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []

    def add(self, array: NDArray[Any], target: int | None = None, normalized: bool = False) -> int:
        """Adds scalars (n,) or vectors (n, 3 or 4) of type f4, u4 or u1, and returns the number of their accessor."""
        kind = "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}"
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": array.nbytes}
        self._views.append(view if target is None else view | {"target": target})
        accessor = {"bufferView": len(self._accessors), "componentType": COMPONENTS[array.dtype.str[1:]]}
        accessor |= {"type": kind, "count": len(array)} | ({"normalized": True} if normalized else {})
        if array.dtype.kind == "f":
            rows = array.reshape(len(array), -1)
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self._accessors.append(accessor)
        self._data += array.astype(array.dtype.newbyteorder("<")).tobytes()
        return len(self._accessors) - 1

    def file(self, document: dict[str, Any]) -> bytes:
        """The file with its tables of nodes, meshes and animations."""
        described = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "materials": [MATERIAL],
            "buffers": [{"byteLength": len(self._data)}],
            "bufferViews": self._views,
            "accessors": self._accessors,
        }
        text = json.dumps(described | document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self._data)
        chunks = struct.pack("<II", len(text), JSON) + text + struct.pack("<II", len(data), BINARY) + data
        return struct.pack("<III", MAGIC, 2, 12 + len(chunks)) + chunks


def glb(vertices: NDArray[np.floating], faces: NDArray[np.integer], colors: NDArray[np.uint8]) -> bytes:
    """A file with one mesh, a colour for each vertex, and its edges, which are darker.

    Args:
        vertices: positions (n, 3) [m].
        faces: vertex indices (m, 3).
        colors: red, green, blue (n, 3), sRGB.
    """
    linear = np.full((len(colors), 4), 255, np.uint8)
    linear[:, :3] = np.round(255 * (colors / 255.0) ** 2.2)  # what glTF wants
    buffer = Buffer()
    position = buffer.add(vertices.astype(np.float32), VERTICES)
    bright = {"POSITION": position, "COLOR_0": buffer.add(linear, VERTICES, normalized=True)}
    linear[:, :3] = EDGE * linear[:, :3]
    dark = {"POSITION": position, "COLOR_0": buffer.add(linear, VERTICES, normalized=True)}
    triangles, edges = (buffer.add(one.ravel().astype(np.uint32), INDICES) for one in (faces, edges_of(faces)[0]))
    surface = {"attributes": bright, "indices": triangles, "material": 0}
    net = {"attributes": dark, "indices": edges, "material": 0, "mode": LINES}
    return buffer.file({"scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "meshes": [{"primitives": [surface, net]}]})
