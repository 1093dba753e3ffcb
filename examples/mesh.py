"""Receives the deformed mesh of a running rig as NumPy arrays and prints its area and how far it has moved.

  python examples/mesh.py [--endpoint tcp/127.0.0.1:7447] [--rig demo] [--tracker sheet]

Needs only abs-service-client, which is in client/ of this repository.
"""

import argparse
import os
from contextlib import suppress

import abs_client
import numpy as np

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--endpoint", default="tcp/127.0.0.1:7447", help="bus.endpoint of the rig")
parser.add_argument("--rig", default="demo", help="its name")
parser.add_argument("--tracker", default="sheet", help="name of one of its trackers")
arguments = parser.parse_args()

try:
    states = abs_client.subscribe(arguments.endpoint, arguments.rig, arguments.tracker)
except abs_client.ClientError as error:
    raise SystemExit(str(error)) from error
try:
    with suppress(KeyboardInterrupt), states:
        for state in states:
            if not state.usable:
                print(state.status, *state.reasons, flush=True)
                continue
            a, b, c = state.vertices[state.faces].swapaxes(0, 1)  # corners (faces, 3) [m], frame of the rig
            area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
            moved = np.linalg.norm(state.vertices - state.undeformed, axis=1).max()
            print(f"{state.seq:6d} {area * 1e4:7.1f} cm², farthest moved {moved * 1e3:6.1f} mm", flush=True)
except BrokenPipeError:  # its reader, as `head`, has seen enough; Python would complain of it at the end
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
