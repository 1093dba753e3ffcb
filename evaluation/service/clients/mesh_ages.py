"""Prints the age of every estimate with its mesh: ENDPOINT."""

import sys
import time

import abs_client


def main(endpoint: str) -> None:
    """Prints until it is killed."""
    for state in abs_client.subscribe(endpoint, rig="demo", tracker="sheet"):
        age_ms = (time.monotonic_ns() - state.t_host_ns) * 1e-6
        print(f"{state.seq} {state.status} here {age_ms:.3f} ms {state.vertices.shape} {state.theta[:6]}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
