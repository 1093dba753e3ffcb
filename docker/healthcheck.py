"""Exit code 0 if a running service publishes health, and no component reports an error.

    python healthcheck.py [ENDPOINT]

It listens as any application would, so it also notices a service that runs but cannot be reached.
"""

import json
import sys
import time

import zenoh
from absmsg.v1.health_pb2 import Health

ENDPOINT = "tcp/127.0.0.1:7447"
TIMEOUT_S = 2.5  # each component publishes once a second


def reports(endpoint: str) -> dict[str, Health]:
    """Latest health of each component that published within the timeout."""
    settings = {
        "mode": "client",
        "connect": {"endpoints": [endpoint], "timeout_ms": 2000},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    }
    latest: dict[str, Health] = {}
    config = zenoh.Config.from_json5(json.dumps(settings))
    with zenoh.open(config) as session, session.declare_subscriber("abs/*/health/**") as subscriber:
        time.sleep(TIMEOUT_S)
        while (sample := subscriber.try_recv()) is not None:
            health = Health.FromString(sample.payload.to_bytes())
            latest[health.component] = health
    return latest


def main() -> int:
    """Prints a line for each component."""
    try:
        latest = reports(sys.argv[1] if len(sys.argv) > 1 else ENDPOINT)
    except zenoh.ZError as error:
        print(f"no service: {error}")
        return 1
    for name, health in sorted(latest.items()):
        print(f"{name}: {Health.Level.Name(health.level).removeprefix('LEVEL_').lower()} {health.message}".rstrip())
    return 0 if latest and all(health.level < Health.LEVEL_ERROR for health in latest.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
