"""Prints every estimate of a running rig: sequence number, status, how old it is on arrival, and Θ.

  python examples/subscribe.py [--endpoint tcp/127.0.0.1:7447] [--topic abs/demo/sheet/state] [--count N]

Needs only zenoh (`pip install eclipse-zenoh`) and the messages in proto/abs/v1. The age is taken on the monotonic
clock, so it is right on the host of the cameras; elsewhere compare `header.stamp` with a synchronised wall clock.
"""

import argparse
import json
import time

import zenoh
from abs.v1.deformation_state_pb2 import DeformationState

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--endpoint", default="tcp/127.0.0.1:7447", help="bus.endpoint of the rig")
parser.add_argument("--topic", default="abs/demo/sheet/state", help="abs/RIG/TRACKER/state")
parser.add_argument("--count", type=int, default=0, help="end after so many estimates (default: with Ctrl-C)")
arguments = parser.parse_args()

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([arguments.endpoint]))

received = 0
with zenoh.open(config) as session, session.declare_subscriber(arguments.topic) as states:
    for sample in states:
        state = DeformationState.FromString(sample.payload.to_bytes())
        age_ms = (time.monotonic_ns() - state.header.t_host_ns) * 1e-6
        status = DeformationState.Status.Name(state.status).removeprefix("STATUS_")
        theta = " ".join(f"{value:+.3f}" for value in state.theta[:6])
        print(f"{state.header.seq:6d} {status:12} {age_ms:6.1f} ms  Θ[{len(state.theta)}] = {theta} …", flush=True)
        received += 1
        if received == arguments.count:
            break
