"""An O3R processing unit with two heads on loopback, in a process of its own: XML-RPC and PCIC, as ifm3d speaks them.

Written after ifm3d's sources (modules/device, modules/framegrabber; Apache-2.0) and its recorded configuration. It is a
process, because ifm3dpy keeps Python's lock while it waits for some answers.

    python -m tests.drivers.o3r.emulated_unit [FILE]     FILE: body of a message, sent instead of synthetic ones

prints the TCP port of its configuration interface. `emulate(head, fault)` of that interface is for tests.
"""

import json
import socketserver
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

import numpy as np

from tests.drivers.o3r import pcic_messages

#: Serial numbers of the heads.
SERIALS = ("000000000281", "000000000282")
#: Images per second.
RATE_HZ = 30.0
#: Messages of every connection before its fault.
BEFORE = 4
PATH = "/api/rpc/v1/com.ifm.efector/"
#: Number of a chunk by its name in the format that the client asks for.
CHUNKS = {
    "RADIAL_DISTANCE_COMPRESSED": 100,
    "AMPLITUDE_COMPRESSED": 101,
    "RADIAL_DISTANCE_NOISE": 105,
    "CONFIDENCE": 300,
    "TOF_INFO": 420,
}
WIDTH, HEIGHT = 8, 6


class Head(socketserver.ThreadingTCPServer):
    """One head: every connection is a run with numbers of its own."""

    daemon_threads = True

    def __init__(self, serial: str, body: bytes) -> None:
        super().__init__(("127.0.0.1", 0), Connection)
        self.serial, self.body, self.fault, self.state = serial, body, "none", "RUN"

    def configuration(self) -> dict:
        return {
            "acquisition": {"framerate": RATE_HZ},
            "data": {"pcicTCPPort": self.server_address[1]},
            "info": {"deviceName": "O3R222", "features": {"type": "3D"}, "serialNumber": self.serial},
            "mode": "standard_range2m",
            "state": self.state,
        }


class Connection(socketserver.StreamRequestHandler):
    """Takes the format of messages and the command to begin, and sends until the client hangs up."""

    def handle(self) -> None:
        chunks: set[int] = set()
        while True:
            start = self.rfile.read(16)
            if len(start) < 16:
                return
            content = self.rfile.read(int(start[5:14]))[4:-2]
            self.wfile.write(start[:4] + b"L%09d\r\n" % 7 + start[:4] + b"*\r\n")
            if content.startswith(b"c"):
                chunks = {CHUNKS[one["id"]] for one in json.loads(content[10:])["elements"] if one["type"] == "blob"}
            elif content == b"p1":
                self.stream(chunks)
                return

    def stream(self, chunks: set[int]) -> None:
        head, number = cast("Head", self.server), 0
        while head.fault != "stall" or number < BEFORE:
            late = number >= BEFORE
            if late and head.fault == "unplug":
                return
            number += 1 + (late and head.fault == "drop")
            strange = late and number % 3 == 0
            if strange and head.fault == "renumber":
                number = 1
            body = head.body or exposure(number, chunks, head.fault if strange else "", serial=int(head.serial))
            try:
                self.wfile.write(b"0000L%09d\r\n" % len(body) + body)
            except OSError:
                return
            time.sleep(1 / RATE_HZ)
        self.rfile.read(1)  # until the client hangs up


def exposure(number: int, chunks: set[int], fault: str = "", serial: int = 0) -> bytes:
    """A message: row r and column c are 100 r + c + number digits away, but for one without return."""
    width, height = (WIDTH, HEIGHT) if fault != "wrong_size" else (WIDTH // 2, HEIGHT // 2)
    distance = 1000 + 100 * np.arange(height)[:, None] + np.arange(width) + number
    distance[0, 0] = 0
    distance = (distance * (fault != "nan")).astype("<u2")
    images = {
        100: (distance.tobytes(), 2),
        101: ((distance % 251).astype("<u2").tobytes(), 2),
        105: ((distance // 50).astype("<u2").tobytes(), 2),
        300: ((distance == 0).astype("<u2").tobytes(), 2),
        420: (pcic_messages.tof_info(lens=pcic_messages.PINHOLE), 0),
    }
    now_ns = time.time_ns() + serial
    return pcic_messages.message(
        *(
            pcic_messages.chunk(kind, content, width, height, form, number, time_ns=now_ns)
            for kind, (content, form) in images.items()
            if kind in chunks
        )
    )


class Handler(SimpleXMLRPCRequestHandler):
    """The path of ifm's interface."""

    rpc_paths = (PATH,)


def main() -> None:
    body = Path(sys.argv[1]).read_bytes() if len(sys.argv) > 1 else b""
    plugged = {f"port{number}": Head(serial, body) for number, serial in enumerate(SERIALS)}
    for head in plugged.values():
        threading.Thread(target=head.serve_forever, daemon=True).start()

    def emulate(serial: str, fault: str, state: str) -> bool:
        for head in plugged.values():
            if head.serial == serial:
                head.fault, head.state = fault, state
        return True

    def get(*pointers: list[str]) -> str:
        two = {"data": {"pcicTCPPort": 1}, "info": {"features": {"type": "2D"}}}
        return json.dumps({"ports": {name: head.configuration() for name, head in plugged.items()} | {"port2": two}})

    server = SimpleXMLRPCServer(("127.0.0.1", 0), Handler, logRequests=False, allow_none=True)
    functions: dict[str, Callable[..., Any]] = {
        "emulate": emulate,
        "get": get,
        "getParameter": lambda key: {"DeviceType": "O3R:768"}[key],
        "getSWVersion": lambda: {"IFM_Software": "1.4.30"},
    }
    for name, function in functions.items():
        server.register_function(function, name)
    print(server.server_address[1], flush=True)
    server.serve_forever()


if __name__ == "__main__":
    main()
