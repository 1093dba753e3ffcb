"""The program: arguments, two connections, an end by signal."""

import argparse
import os
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from abs_client.link import DEFAULT_ENDPOINT, ClientError, Link, Tls
from abs_client.rig import LARGEST_AGE_S

#: Exit status for what the user can mend.
USER_ERROR = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Publishes until Ctrl-C or SIGTERM; returns the exit status."""
    given = _parser().parse_args(arguments)
    try:
        from abs_client.ros2 import layout, node, republisher  # noqa: PLC0415 an extra
    except ModuleNotFoundError as error:
        return _complain(f"{error.name} is not installed: pip install 'abs-service-client[ros2]'")
    end = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: end.set())
    try:
        with (
            node.RosNode(given.router, given.node or f"abs_{layout.ros_name(given.rig)}", given.domain) as ros_node,
            Link(given.endpoint, given.rig, _tls(given.tls)) as link,
        ):
            print(f"rig {given.rig} at {given.endpoint}: to ROS domain {given.domain} at {given.router}", flush=True)
            republisher.Republisher(link, ros_node, given.largest_age).run(end)
    except ClientError as error:
        return _complain(str(error))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "abs-ros2", description="Publishes what a rig publishes for ROS 2 nodes that use rmw_zenoh; needs no ROS."
    )
    parser.add_argument("--endpoint", default=DEFAULT_ENDPOINT, help="bus.endpoint of the rig [%(default)s]")
    parser.add_argument("--rig", default="demo", help="its name [%(default)s]")
    parser.add_argument("--router", required=True, help="endpoint of rmw_zenohd, such as tcp/127.0.0.1:7447")
    parser.add_argument(
        "--domain", type=_domain, default=os.environ.get("ROS_DOMAIN_ID") or "0", help="[ROS_DOMAIN_ID]"
    )
    parser.add_argument("--node", help="name of the node [abs_RIG]")
    parser.add_argument(
        "--largest-age", type=float, default=LARGEST_AGE_S, help="of estimates, in seconds [%(default)s]"
    )
    parser.add_argument(
        "--tls", type=Path, nargs=3, metavar=("AUTHORITY", "CERTIFICATE", "KEY"), help="for a rig with [bus.tls]"
    )
    return parser


def _domain(text: str) -> int:
    if not (text.isdecimal() and int(text) <= 232):
        raise argparse.ArgumentTypeError(f"{text!r} is no ROS domain: a number from 0 to 232")
    return int(text)


def _tls(files: Sequence[Path] | None) -> Tls | None:
    return Tls(*files) if files else None


def _complain(reason: str) -> int:
    print(reason, file=sys.stderr)
    return USER_ERROR
