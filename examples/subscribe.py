"""Prints every estimate of a running rig: number, status, age when published and on arrival, and the beginning of Θ.

Needs only zenoh (`pip install eclipse-zenoh`) and the messages in proto/absmsg/v1.
"""

import argparse
import json
import os
import time
from contextlib import suppress
from itertools import islice

import zenoh
from absmsg.v1.deformation_state_pb2 import DeformationState

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--endpoint", default="tcp/127.0.0.1:7447", help="bus.endpoint of the rig")
parser.add_argument("--topic", default="abs/demo/sheet/state", help="abs/RIG/TRACKER/state")
parser.add_argument("--count", type=int, help="end after so many estimates (default: with Ctrl-C)")
arguments = parser.parse_args()

settings = {"mode": "client", "connect": {"endpoints": [arguments.endpoint]}}
settings["transport"] = {"shared_memory": {"enabled": False}}  # zenoh would lock more than `ulimit -l` may allow
try:
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))
except zenoh.ZError as error:
    raise SystemExit(f"nothing answers at {arguments.endpoint}: is abs-service running?") from error
newest = zenoh.handlers.RingChannel(30)  # a reader slower than the tracker loses the oldest, and is never a second late
try:
    with suppress(KeyboardInterrupt), session:
        states = session.declare_subscriber(arguments.topic, newest)
        for sample in islice(states, arguments.count):
            state = DeformationState.FromString(sample.payload.to_bytes())
            age_ms = (time.monotonic_ns() - state.header.t_host_ns) * 1e-6  # right on the host of the cameras only
            status = DeformationState.Status.Name(state.status).removeprefix("STATUS_")
            theta = f"Θ[{len(state.theta)}] = {' '.join(f'{value:+.3f}' for value in state.theta[:6])} …"
            ages = f"published {state.age_ms:5.1f} ms, here {age_ms:5.1f} ms"
            print(f"{state.header.seq:6d} {status:12} {ages}  {theta}", flush=True)
except BrokenPipeError:  # its reader, as `head`, has seen enough; Python would complain of it at the end
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
