"""Prints the age of every mesh in rmw_zenoh's layout: ENDPOINT of the router of ROS."""

import json
import sys
import time
from typing import Any

import zenoh
from rosbags.typesys import Stores, get_typestore

KEY = "0/demo/sheet/mesh/visualization_msgs::msg::dds_::Marker_/*"


def main(endpoint: str) -> None:
    """Prints until it is killed."""
    types = get_typestore(Stores.ROS2_JAZZY)
    config = zenoh.Config.from_json5(json.dumps({"mode": "client", "connect": {"endpoints": [endpoint]}}))
    newest = zenoh.handlers.RingChannel(4)
    with zenoh.open(config) as session, session.declare_subscriber(KEY, newest) as samples:
        for sample in samples:
            marker: Any = types.deserialize_cdr(sample.payload.to_bytes(), "visualization_msgs/msg/Marker")
            stamp_ns = marker.header.stamp.sec * 10**9 + marker.header.stamp.nanosec
            print(f"{len(marker.points)} points, here {(time.time_ns() - stamp_ns) * 1e-6:.3f} ms", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
