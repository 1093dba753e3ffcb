"""A mesh with a colour for each vertex as binary glTF 2.0: the viewer's own meshes have one colour each."""

import json
import struct

import numpy as np
from numpy.typing import NDArray

#: Values of the format: component types, kinds of buffer, and the marks of file and chunks.
FLOAT, UNSIGNED_INT, UNSIGNED_BYTE = 5126, 5125, 5121
VERTICES, INDICES = 34962, 34963
MAGIC, JSON, BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942


def glb(vertices: NDArray[np.floating], faces: NDArray[np.integer], colors: NDArray[np.uint8]) -> bytes:
    """The file.

    Args:
        vertices: positions (n, 3) [m].
        faces: vertex indices (m, 3).
        colors: red, green, blue (n, 3), sRGB.
    """
    positions = np.ascontiguousarray(vertices, "<f4")
    linear = np.full((len(colors), 4), 255, np.uint8)
    linear[:, :3] = np.round(255 * (colors / 255.0) ** 2.2)  # what glTF wants
    parts = [
        (positions, VERTICES, FLOAT, "VEC3", len(positions)),
        (linear, VERTICES, UNSIGNED_BYTE, "VEC4", len(linear)),
        (np.ascontiguousarray(faces, "<u4"), INDICES, UNSIGNED_INT, "SCALAR", 3 * len(faces)),
    ]
    views, accessors, data = [], [], b""
    for number, (array, target, component, kind, count) in enumerate(parts):
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes, "target": target})
        accessors.append({"bufferView": number, "componentType": component, "type": kind, "count": count})
        data += array.tobytes()
    accessors[0] |= {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    accessors[1]["normalized"] = True
    surface = {"metallicFactor": 0.0, "roughnessFactor": 0.9}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": surface, "doubleSided": True}],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), JSON) + text + struct.pack("<II", len(data), BINARY) + data
    return struct.pack("<III", MAGIC, 2, 12 + len(chunks)) + chunks
