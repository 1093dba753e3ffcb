"""The program `abs-ros2`."""

import argparse
import os
from collections.abc import Sequence

from abs_client import programs
from abs_client.errors import ClientError


def main(arguments: Sequence[str] | None = None) -> int:
    """Publishes until Ctrl-C or SIGTERM; returns the exit status."""
    given = _parser().parse_args(arguments)
    try:
        from abs_client.ros2 import layout, node, republisher  # noqa: PLC0415 an extra
    except ModuleNotFoundError as error:
        return programs.complain(
            f"{error.name} is not installed: pip install './client[ros2]' in a clone of abs-service"
        )
    end = programs.end_signal()
    name = given.node or f"abs_{layout.ros_name(given.rig)}"
    try:
        with node.RosNode(given.router, name, given.domain) as ros_node, programs.link(given) as link:
            print(f"rig {given.rig} at {given.endpoint}: to ROS domain {given.domain} at {given.router}", flush=True)
            republisher.Republisher(link, ros_node, given.maximum_age).run(end)
    except ClientError as error:
        return programs.complain(error)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "abs-ros2", description="Publishes what a rig publishes for ROS 2 nodes that use rmw_zenoh; needs no ROS."
    )
    programs.add_rig(parser)
    parser.add_argument("--router", required=True, help="endpoint of rmw_zenohd, such as tcp/127.0.0.1:7447")
    parser.add_argument(
        "--domain", type=_domain, default=os.environ.get("ROS_DOMAIN_ID") or "0", help="[ROS_DOMAIN_ID, or 0]"
    )
    parser.add_argument("--node", help="name of the node [abs_RIG]")
    return parser


def _domain(text: str) -> int:
    if not (text.isdecimal() and int(text) <= 232):
        raise argparse.ArgumentTypeError(f"{text!r} is no ROS domain: a number from 0 to 232")
    return int(text)
