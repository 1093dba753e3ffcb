"""The tables `[bus]` and `[bus.tls]` of a configuration file."""

from typing import Self

from pydantic import model_validator

from abs_service.bus.security.mutual_tls import NO_SECURITY, MutualTls, NoSecurity
from abs_service.bus.session import DEFAULT_ENDPOINT
from abs_service.config.problems import Problem, ProblemsError
from abs_service.config.tables.table import Table
from abs_service.config.tables.values import Endpoint, RelativePath


class TlsTable(Table):
    """`[bus.tls]`: encryption and access rights; the endpoint begins with `tls/` then.

    Attributes:
        authority: certificate of the authority that signed those of all hosts, like the others in PEM format.
        certificate: this host's; its common name says what it may do: `rig`, `capture`, `tracker`, `recorder`,
            `viewer` or `operator` (docs/how-to/mutual-tls.md).
        key: its private key.
    """

    authority: RelativePath
    certificate: RelativePath
    key: RelativePath


class BusTable(Table):
    """`[bus]`: transport between the processes of a rig.

    Attributes:
        endpoint: zenoh endpoint that `run` listens on and all others connect to.
        shared_memory: images travel through shared memory between processes of one host.
        routers: zenoh endpoints of other routers, such as one for a whole lab, that the router of this rig connects
            to whenever they are there; who is connected to them reads this rig as well.
        tls: mutual TLS; without it, whoever reaches the endpoint may do everything.
    """

    endpoint: Endpoint = DEFAULT_ENDPOINT
    routers: tuple[Endpoint, ...] = ()
    shared_memory: bool = True
    tls: TlsTable | None = None

    @model_validator(mode="after")
    def _encrypted(self) -> Self:
        places = {("endpoint",): self.endpoint} | {("routers", number): one for number, one in enumerate(self.routers)}
        problem = "must begin with tls/, because there is a table [bus.tls]"
        problems = [Problem(place, problem, one) for place, one in places.items() if not one.startswith("tls/")]
        if self.tls and problems:
            raise ProblemsError(problems)
        return self

    def security(self, *names: str) -> NoSecurity | MutualTls:
        """Authentication of a process whose certificate has one of these common names."""
        if self.tls is None:
            return NO_SECURITY
        return MutualTls(self.tls.authority, self.tls.certificate, self.tls.key, names)
