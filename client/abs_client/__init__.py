"""Receives what a running abs-service publishes: how the object in view of its cameras deforms.

for state in abs_client.subscribe("tcp/127.0.0.1:7447", rig="demo", tracker="sheet"):
    if state.usable:
        print(state.status, state.vertices.shape, state.age_s)
"""

from abs_client.camera import Camera
from abs_client.connection.tls import Tls
from abs_client.errors import ClientError, MalformedError, RangeError, UnknownNameError, UnreachableError
from abs_client.estimates.state import State, Status
from abs_client.images import Image, ImageError
from abs_client.rig import RefusedError, Rig, subscribe
from abs_client.simulated_rig import RigFailedError, RunningRig, SimulatedRig, run_rig
from abs_client.stream import NothingReceivedError, Stream

__all__ = [
    "Camera",
    "ClientError",
    "Image",
    "ImageError",
    "MalformedError",
    "NothingReceivedError",
    "RangeError",
    "RefusedError",
    "Rig",
    "RigFailedError",
    "RunningRig",
    "SimulatedRig",
    "State",
    "Status",
    "Stream",
    "Tls",
    "UnknownNameError",
    "UnreachableError",
    "run_rig",
    "subscribe",
]
