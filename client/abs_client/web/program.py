"""The program `abs-web`."""

import argparse
import threading
from collections.abc import Sequence

from abs_client import programs
from abs_client.errors import ClientError
from abs_client.web.server import EstimateServer


def main(arguments: Sequence[str] | None = None) -> int:
    """Serves until Ctrl-C or SIGTERM; returns the exit status."""
    given = _parser().parse_args(arguments)
    end = programs.end_signal()
    try:
        with (
            programs.link(given) as link,
            EstimateServer((given.host, given.port), link, given.maximum_age, given.origin) as server,
        ):
            threading.Thread(target=server.serve_forever, daemon=True).start()
            print(f"rig {given.rig} at {given.endpoint}: http://{given.host}:{server.server_port}/", flush=True)
            end.wait()
            link.close()
            server.shutdown()
    except ClientError as error:
        return programs.complain(error)
    except OSError as error:
        return programs.complain(f"--host {given.host} --port {given.port}: {error.strerror}; choose another")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "abs-web", description="Serves the estimates of a rig for JavaScript, as server-sent events, and a page."
    )
    programs.add_rig(parser)
    parser.add_argument(
        "--host", default="127.0.0.1", help="address to listen at [%(default)s]; others let others read"
    )
    parser.add_argument("--port", type=_port, default=8081, help="[%(default)s]")
    parser.add_argument("--origin", default="", help="of pages elsewhere that may read, such as http://localhost:3000")
    return parser


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 6 and int(text) < 65_536):
        raise argparse.ArgumentTypeError(f"{text!r} must be a port from 0 to 65535")
    return int(text)
