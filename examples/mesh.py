"""Receives the deformed mesh of a running rig as NumPy arrays and prints its area and how far it has moved.

  python examples/mesh.py [--endpoint tcp/127.0.0.1:7447] [--tracker abs/demo/sheet]

Faces and undeformed vertices are asked for, once per mesh; the deformed vertices arrive with every estimate.
"""

import argparse
import json
from contextlib import suppress

import numpy as np
import zenoh
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--endpoint", default="tcp/127.0.0.1:7447", help="bus.endpoint of the rig")
parser.add_argument("--tracker", default="abs/demo/sheet", help="abs/RIG/TRACKER")
arguments = parser.parse_args()

config = zenoh.Config.from_json5(json.dumps({"mode": "client", "connect": {"endpoints": [arguments.endpoint]}}))
topologies: dict[tuple[str, int], MeshTopology] = {}
with suppress(KeyboardInterrupt), zenoh.open(config) as session:
    newest = session.declare_subscriber(f"{arguments.tracker}/mesh", zenoh.handlers.RingChannel(1))
    for sample in newest:
        mesh = DeformedMesh.FromString(sample.payload.to_bytes())
        version = mesh.header.boot_id, mesh.mesh_version  # a restarted tracker counts its meshes from one again
        if version not in topologies:
            answers = [answer.ok for answer in session.get(f"{arguments.tracker}/topology")]
            found = [MeshTopology.FromString(answer.payload.to_bytes()) for answer in answers if answer]
            topologies = {(topology.header.boot_id, topology.mesh_version): topology for topology in found}
        topology = topologies.get(version)
        if topology is None:
            continue  # no object found yet, or vertices that a new mesh has overtaken
        vertices = np.frombuffer(mesh.vertices_f32, "<f4").reshape(-1, 3)  # (n, 3) [m], frame of the rig
        undeformed = np.frombuffer(topology.rest_vertices_f32, "<f4").reshape(-1, 3)
        a, b, c = vertices[np.frombuffer(topology.faces_u32, "<u4").reshape(-1, 3)].swapaxes(0, 1)  # corners
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
        moved = np.linalg.norm(vertices - undeformed, axis=1).max()
        print(f"{mesh.header.seq:6d} {area * 1e4:7.1f} cm², farthest moved {moved * 1e3:6.1f} mm", flush=True)
