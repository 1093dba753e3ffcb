"""Mutual TLS of the bus. Its files are checked first, as zenoh reports any mistake in them as a lack of answers."""

import json
import socket
import ssl
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from abs_service.bus.security import roles

#: Time in which a router has to answer a handshake, and to refuse a client [s].
ANSWER_S = 2.0
#: Time in which who speaks TLS answers its first message; `abs-service status` ends within two seconds [s].
PROBE_S = 0.5
#: A listener without TLS ends a handshake after two seconds; one that hangs does not answer, either.
NO_TLS = "no TLS is spoken there, or it hangs; compare with the bus.endpoint and the table [bus.tls] of who listens"
#: X509_V_ERR_INVALID_PURPOSE of OpenSSL: here, a certificate of a client at a process that listens.
INVALID_PURPOSE = 26


class TlsError(Exception):
    """A file of `[bus.tls]` that cannot be used."""

    def __init__(self, key: str, value: str, problem: str) -> None:
        self.key, self.value, self.problem = key, value, problem
        super().__init__(f"bus.tls.{key} = {json.dumps(value, ensure_ascii=False)}: {problem}")


@dataclass(frozen=True, slots=True)
class Certificate:
    """Common name of a certificate, and the moment at which it or its authority ends."""

    name: str
    ends: datetime


@dataclass(frozen=True, slots=True)
class NoSecurity:
    """A bus without TLS: every program that reaches its endpoint has all rights."""

    #: Parts of zenoh's configuration: of its links, of a router.
    link: Mapping[str, Any] = field(default_factory=dict)
    router: Mapping[str, Any] = field(default_factory=dict)

    def check(self, endpoint: str, listens: bool) -> None:
        """Accepts everything: there are no files to check."""

    def refusal(self, endpoint: str) -> str:
        """Reason for which a router refuses this process; "" if unknown."""
        if not endpoint.startswith(("tcp/", "tls/")) or not _speaks_tls(endpoint):
            return ""
        return "TLS is spoken there; give a rig file whose table [bus.tls] names certificates, and an endpoint tls/…"


NO_SECURITY = NoSecurity()


@dataclass(frozen=True, slots=True)
class MutualTls:
    """Every process authenticates by a certificate; the router grants the rights of its common name (`roles`).

    Attributes:
        authority: certificate of the authority that signed all the others; PEM, like the others.
        certificate: of this host; its common name is one of `roles.NAMES`.
        key: private key of that certificate.
        names: common names that allow this process to do its work.
    """

    authority: Path
    certificate: Path
    key: Path
    names: tuple[str, ...] = roles.NAMES

    @property
    def link(self) -> Mapping[str, Any]:
        """See `NoSecurity`."""
        own = {f"{side}_certificate": str(self.certificate) for side in ("listen", "connect")}
        own |= {f"{side}_private_key": str(self.key) for side in ("listen", "connect")}
        return {"tls": {"root_ca_certificate": str(self.authority), "enable_mtls": True, **own}}

    @property
    def router(self) -> Mapping[str, Any]:
        """See `NoSecurity`."""
        return {"access_control": roles.access_control()}

    def check(self, endpoint: str, listens: bool) -> Certificate:
        """The certificate of this host, which others will accept.

        Args:
            endpoint: of the router.
            listens: whether this process is the router.

        Raises:
            TlsError: a file cannot be read, has ended, or does not fit to the others or to the endpoint.
        """
        for key in ("authority", "certificate", "key"):
            try:
                getattr(self, key).read_bytes()
            except OSError as error:
                raise self._error(key, f"cannot be read: {error.strerror}") from None
        host = _host(endpoint) if listens else None
        client, server = self._context(ssl.PROTOCOL_TLS_CLIENT), self._context(ssl.PROTOCOL_TLS_SERVER)
        client.check_hostname, client.verify_mode = listens, ssl.CERT_REQUIRED if listens else ssl.CERT_NONE
        server.verify_mode = ssl.CERT_REQUIRED
        try:
            found = _handshake(client, server, host)
        except ssl.SSLCertVerificationError as error:
            problem = f"others refuse it, by {self.authority}: {error.verify_message}"
            remedy = f"; a process that listens needs {roles.RIG}.pem" * (error.verify_code == INVALID_PURPOSE)
            raise self._error("certificate", problem + remedy) from None
        allowed = (roles.RIG,) if listens else self.names
        if found.name not in allowed:
            raise self._error("certificate", f'its name is "{found.name}"; this process needs {" or ".join(allowed)}')
        return Certificate(found.name, min(found.ends, *(_end(one) for one in server.get_ca_certs())))

    def refusal(self, endpoint: str) -> str:
        """See `NoSecurity`; connects once more, since zenoh does not report it."""
        address = _address(endpoint)
        try:
            plain = socket.create_connection(address, ANSWER_S)
        except OSError:
            return ""
        with plain:
            try:
                link = self._context(ssl.PROTOCOL_TLS_CLIENT).wrap_socket(plain, server_hostname=address[0])
            except ssl.SSLCertVerificationError as error:
                return f"its certificate is refused here: {error.verify_message}"
            except OSError as error:
                return _refused(error) if isinstance(error, ssl.SSLError) and _speaks_tls(endpoint) else NO_TLS
        with link:
            try:
                link.recv(1)  # what the router thinks of our certificate comes after the handshake
            except ssl.SSLError as error:
                return _refused(error)
            except OSError:  # it has nothing to say
                return ""
        return ""

    def _context(self, protocol: int) -> ssl.SSLContext:
        context = ssl.SSLContext(protocol)
        for key in ("authority", "certificate"):
            try:
                # That of our own is only tried, by a context of its own.
                (context if key == "authority" else ssl.SSLContext(protocol)).load_verify_locations(getattr(self, key))
            except ssl.SSLError:
                raise self._error(key, "holds no certificate in PEM format") from None
        try:
            context.load_cert_chain(self.certificate, self.key, password=lambda: "")
        except ssl.SSLError as error:
            belongs = error.reason == "KEY_VALUES_MISMATCH"
            problem = f"does not belong to {self.certificate}" if belongs else "holds no private key in PEM format"
            raise self._error("key", problem) from None
        return context

    def _error(self, key: str, problem: str) -> TlsError:
        return TlsError(key, str(getattr(self, key)), problem)


def _refused(error: ssl.SSLError) -> str:
    return f"it refuses this certificate: {(error.reason or str(error)).lower().replace('_', ' ')}"


def _host(endpoint: str) -> str:
    return _address(endpoint)[0]


def _address(endpoint: str) -> tuple[str, int]:
    host, _, port = endpoint.partition("/")[2].partition("#")[0].rpartition(":")
    return host.strip("[]"), int(port)


def _speaks_tls(endpoint: str) -> bool:
    """True if what listens at an endpoint answers the first message of TLS, with its certificate or an alert."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    try:
        with socket.create_connection(_address(endpoint), PROBE_S) as plain, context.wrap_socket(plain):
            return True
    except ssl.SSLError as error:
        return "ALERT" in (error.reason or "")
    except OSError:
        return False


def _handshake(client: ssl.SSLContext, server: ssl.SSLContext, host: str | None) -> Certificate:
    """Performs a TLS handshake in memory; returns the client's certificate as the server sees it."""
    to_client, to_server = ssl.MemoryBIO(), ssl.MemoryBIO()
    one = client.wrap_bio(to_client, to_server, server_hostname=host)
    other = server.wrap_bio(to_server, to_client, server_side=True)
    for side in (one, other, one, other):
        with suppress(ssl.SSLWantReadError):
            side.do_handshake()
    found: Any = other.getpeercert()
    subject = dict(pair for group in found["subject"] for pair in group)
    return Certificate(subject.get("commonName", ""), _end(found))


def _end(found: Mapping[str, Any]) -> datetime:
    return datetime.fromtimestamp(ssl.cert_time_to_seconds(found["notAfter"]), UTC)
