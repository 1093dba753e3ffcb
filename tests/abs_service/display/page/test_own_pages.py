"""The live page answers itself, and no page of another site that a browser has open."""

import base64
import socket

import pytest

from tests.ports import free_port

viser = pytest.importorskip("viser")

from abs_service.display.page.own_pages import is_own, own_pages_only  # noqa: E402 - needs the package of viser


@pytest.mark.parametrize(
    ("host", "origin", "own"),
    [
        ("127.0.0.1:8080", "http://127.0.0.1:8080", True),
        ("localhost:9000", "http://localhost:9000", True),  # through ssh -L 9000:…
        ("[::1]:8080", "http://[::1]:8080", True),
        ("127.0.0.1:8080", "", True),
        ("127.0.0.1:8080", "http://evil.example", False),
        ("127.0.0.1:8080", "http://127.0.0.1:8081", False),
        ("127.0.0.1:8080", "null", False),
        ("evil.example:8080", "http://evil.example:8080", False),
        ("evil.example:8080", "", False),
        ("[::1", "", False),
        ("", "", False),
    ],
)
def test_a_request_comes_from_this_host_s_page_or_from_none(host, origin, own):
    assert is_own(host, origin) == own


def answer(port: int, host: str, *headers: str) -> str:
    """The first line of the server's answer."""
    with socket.create_connection(("127.0.0.1", port), 5) as connection:
        connection.sendall("\r\n".join(("GET / HTTP/1.1", f"Host: {host}", *headers, "", "")).encode())
        return connection.recv(1000).partition(b"\r\n")[0].decode()


def test_the_server_of_the_page_refuses_other_sites():
    with own_pages_only():
        server = viser.ViserServer("127.0.0.1", free_port(), verbose=False)
    try:
        port = server.get_port()
        host = f"127.0.0.1:{port}"
        key = base64.b64encode(bytes(16)).decode()
        upgrade = (
            "Upgrade: websocket",
            "Connection: Upgrade",
            f"Sec-WebSocket-Key: {key}",
            "Sec-WebSocket-Version: 13",
        )
        assert answer(port, host, f"Origin: http://{host}", *upgrade) == "HTTP/1.1 101 Switching Protocols"
        assert answer(port, host) == "HTTP/1.1 200 OK"
        assert answer(port, host, "Origin: http://evil.example", *upgrade) == "HTTP/1.1 403 Forbidden"
        assert answer(port, "evil.example") == "HTTP/1.1 403 Forbidden"
    finally:
        server.stop()
