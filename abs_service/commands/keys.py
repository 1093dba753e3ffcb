"""Makes the certificates of a lab, for `[bus.tls]`: an authority, and one certificate for each role.

  abs-service keys keys --host rig.lab                       rig.lab runs `abs-service run`, or capture with --listen
  abs-service keys new --host rig.lab --authority keys       once those in keys have ended
  abs-service keys bob --only viewer --authority keys        one more

The names are rig (the host that the others connect to: may do everything), capture, tracker, recorder, viewer (reads)
and operator (reads, and sends commands). docs/how-to/mutual-tls.md says which files belong where. Keep authority.key
off the rigs: whoever has it makes certificates. Nothing that exists is overwritten.
"""

import argparse
import ipaddress
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from abs_service.bus.security import roles
from abs_service.bus.security.mutual_tls import MutualTls
from abs_service.commands.parts.options import OptionError, whole
from abs_service.recording.disk import folder
from abs_service.supervision.exit_codes import Exit

AUTHORITY = "authority"
#: Life of an authority [days].
AUTHORITY_DAYS = 3650
_DAYS = whole(AUTHORITY_DAYS, "a number of days", 1)

_AUTHORITY = "basicConstraints = critical, CA:true, pathlen:0\nkeyUsage = critical, keyCertSign, cRLSign"
_LEAF = "basicConstraints = critical, CA:false\nkeyUsage = critical, digitalSignature"
#: The names of hosts are in that of the rig alone, so that no other one can pretend to be it.
_RIG = _LEAF + "\nextendedKeyUsage = serverAuth, clientAuth\nsubjectAltName = {hosts}"
_CLIENT = _LEAF + "\nextendedKeyUsage = clientAuth"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service keys`."""
    parser.add_argument("out", metavar="DIR", type=Path, help="folder to write; it must not exist")
    parser.add_argument(
        "--host",
        metavar="NAME",
        action="append",
        default=[],
        help="name or IP address by which others reach the host that listens; may be given several times",
    )
    parser.add_argument("--only", metavar="ROLE", choices=roles.NAMES, action="append", help="only for this role")
    parser.add_argument("--authority", metavar="DIR", type=Path, help="sign with the authority in this folder")
    parser.add_argument("--days", metavar="N", type=_DAYS, default=365, help="life of the certificates (default: 365)")


def run(arguments: argparse.Namespace) -> int:
    """Makes the folder with all of its certificates; none is left after an error."""
    out, names = arguments.out, arguments.only or roles.NAMES
    if roles.RIG in names and not arguments.host:
        raise OptionError(f"--host: give the name of the host that listens, for the certificate of {roles.RIG}")
    if out.exists():
        raise OptionError(f"{out}: exists, and nothing is overwritten; choose another folder")
    try:
        folder.make(out.parent)
        with tempfile.TemporaryDirectory(prefix=".keys-", dir=out.parent) as temporary:
            made = Path(temporary) / "made"
            made.mkdir(mode=0o700)
            _make(made, names, arguments.host, arguments.authority, arguments.days)
            ends = [f"  {name}.pem, {name}.key: until {_ends(made, name)}" for name in names]
            os.rename(made, out)
    except OSError as error:
        raise OptionError(f"{error.filename or out}: {error.strerror}") from None
    print("\n".join([f"wrote {out}", *ends]))
    return Exit.OK


def _make(made: Path, names: Sequence[str], hosts: Sequence[str], authority: Path | None, days: int) -> None:
    if authority is None:
        _request(made, AUTHORITY, AUTHORITY_DAYS, _AUTHORITY, "abs-service authority")
    else:
        shutil.copy(authority / f"{AUTHORITY}.pem", made)
    own = (authority or made) / AUTHORITY
    signed_by = ("-CA", f"{own}.pem", "-CAkey", f"{own}.key")
    for name in names:
        extensions = _RIG.format(hosts=", ".join(map(_alternative, hosts))) if name == roles.RIG else _CLIENT
        _request(made, name, days, extensions, name, signed_by)


def _request(folder: Path, file: str, days: int, extensions: str, name: str, signed_by: Sequence[str] = ()) -> None:
    """Makes a key and its certificate.

    Raises:
        OptionError: OpenSSL is not installed, or refuses.
    """
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-noenc", "-sha256"]
    command += ["-config", "/dev/stdin", "-extensions", "extensions", "-subj", f"/CN={name}", "-days", str(days)]
    command += ["-keyout", str(folder / f"{file}.key"), "-out", str(folder / f"{file}.pem"), *signed_by]
    settings = f"[req]\ndistinguished_name = name\n[name]\n[extensions]\n{extensions}\n"
    try:
        done = subprocess.run(command, input=settings, capture_output=True, text=True, check=False, umask=0o077)
    except FileNotFoundError:
        raise OptionError("the program openssl (3.0 or newer) makes the certificates, and is not installed") from None
    if done.returncode:
        raise OptionError(f"{file}.pem: openssl cannot make it: {done.stderr.strip()}")
    (folder / f"{file}.pem").chmod(0o644)


def _alternative(host: str) -> str:
    """A name or address as a subject alternative name.

    Raises:
        OptionError: it is neither.
    """
    try:
        return f"IP:{ipaddress.ip_address(host)}"
    except ValueError:
        pass
    if not re.fullmatch(r"[A-Za-z0-9-]+(\.[A-Za-z0-9-]+)*", host):
        raise OptionError(f"--host {host}: neither a name nor an IP address")
    return f"DNS:{host}"


def _ends(folder: Path, name: str) -> str:
    made = MutualTls(folder / f"{AUTHORITY}.pem", folder / f"{name}.pem", folder / f"{name}.key")
    return made.check("", listens=False).ends.date().isoformat()
