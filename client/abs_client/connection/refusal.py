"""Reasons for which a router is not reached though it is there: TLS on one side only, certificates that are refused."""

import socket
import ssl

from abs_client.connection.tls import Tls

#: Time in which a router has to connect, and to answer each part of a handshake [s].
ANSWER_S = 2.0


def reason(endpoint: str, tls: Tls | None) -> str:
    """Obstacle between this program and the router at an endpoint; "" if unknown.

    Connects once more, since zenoh says only that there is no answer.
    """
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.partition("#")[0].rpartition(":")
    if protocol not in ("tcp", "tls"):
        return ""
    try:
        context = _context(tls)
    except ssl.SSLError:
        return "the files of its Tls are not PEM, or the key does not belong to the certificate"
    try:
        plain = socket.create_connection((host.strip("[]"), int(port)), ANSWER_S)
    except OSError:
        return ""
    with plain:
        try:
            with context.wrap_socket(plain, server_hostname=host.strip("[]")) as link:
                return _answer(link, protocol, tls)
        except OSError as error:
            return _broken_off(error, protocol)


def _broken_off(error: OSError, protocol: str) -> str:
    """The reason of a handshake that failed."""
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"its certificate is refused here: {error.verify_message}"
    if isinstance(error, ssl.SSLError) and "ALERT" in (error.reason or ""):
        return _refused(error)
    return "no TLS is spoken there, or it hangs" if protocol == "tls" else ""


def _context(tls: Tls | None) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    if tls is None:
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    else:
        context.load_verify_locations(tls.authority)
        context.load_cert_chain(tls.certificate, tls.key, password=lambda: "")
    return context


def _answer(link: ssl.SSLSocket, protocol: str, tls: Tls | None) -> str:
    """Answer of a router that speaks TLS: it judges the certificate after the handshake."""
    if protocol == "tcp" or tls is None:
        return "TLS is spoken there: give an endpoint tls/… and the certificates of a Tls"
    try:
        link.recv(1)
    except ssl.SSLError as error:
        return _refused(error)
    except OSError:
        pass  # it has nothing to say
    return ""


def _refused(error: ssl.SSLError) -> str:
    return f"it refuses this certificate: {(error.reason or str(error)).lower().replace('_', ' ')}"
