"""Tells a gripper where the middle of the sheet is, and to hold still when that is not known.

python -m gripper.hold [ENDPOINT]
"""

import sys
from collections.abc import Iterable, Iterator

import abs_client
import numpy as np

#: Beyond this σ the sheet is not gripped [m].
MAX_SIGMA = 0.005


def targets(states: Iterable[abs_client.State]) -> Iterator[np.ndarray | None]:
    """Middle (3,) of the sheet in the rig's frame [m] for each estimate; None: hold still."""
    for state in states:
        if state.usable and np.median(state.sigma) < MAX_SIGMA:
            yield state.vertices.mean(axis=0)
        else:
            yield None


if __name__ == "__main__":
    endpoint = sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"
    for target in targets(abs_client.subscribe(endpoint, rig="demo", tracker="sheet")):
        print("hold still" if target is None else np.round(target, 3), flush=True)
