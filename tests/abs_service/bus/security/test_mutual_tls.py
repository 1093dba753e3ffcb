"""Files of mutual TLS that cannot be used, and clients that are refused, are explained."""

import shutil
import subprocess
from datetime import UTC, datetime, timedelta

import pytest

from abs_service import cli
from abs_service.bus import links, session
from abs_service.bus.security import expiry
from abs_service.bus.security.expiry import Expiry
from abs_service.bus.security.mutual_tls import NO_SECURITY, Certificate, MutualTls, TlsError
from abs_service.bus.session import BusError, SessionMode, check_endpoint, open_session
from abs_service.bus.zenoh_bus import ZenohBus
from tests.conftest import encrypted
from tests.system.running import wait_until


@pytest.fixture
def lab(keys, tmp_path):
    """A copy of the certificates, to be spoilt."""
    return shutil.copytree(keys, tmp_path / "keys")


def tls(folder, name="viewer", key=None):
    return MutualTls(folder / "authority.pem", folder / f"{name}.pem", folder / f"{key or name}.key")


def openssl(*arguments):
    subprocess.run(["openssl", *map(str, arguments)], check=True, capture_output=True)


def expire(folder, name):
    """Signs a certificate anew that ends now; OpenSSL 3.6 refuses one that ended before it began."""
    request = folder / "request"
    openssl("req", "-new", "-key", folder / f"{name}.key", "-subj", f"/CN={name}", "-out", request)
    authority = ("-CA", folder / "authority.pem", "-CAkey", folder / "authority.key")
    openssl("x509", "-req", "-in", request, *authority, "-days", "0", "-out", folder / f"{name}.pem")


def test_what_is_right_has_a_name_and_an_end(keys):
    for name in ("viewer", "rig"):
        found = tls(keys, name).check("tls/localhost:1", listens=name == "rig")
        assert found.name == name
        assert timedelta(days=364) < found.ends - datetime.now(UTC) < timedelta(days=366)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda lab: (lab / "viewer.key").unlink(), r'bus\.tls\.key = ".*viewer\.key": cannot be read: No such file'),
        (lambda lab: (lab / "authority.pem").unlink(), r"bus\.tls\.authority = .*: cannot be read: No such file"),
        (lambda lab: (lab / "viewer.pem").write_text("x"), r"bus\.tls\.certificate = .*: holds no certificate in PEM"),
        (lambda lab: (lab / "authority.pem").write_text(""), r"bus\.tls\.authority = .*: holds no certificate in PEM"),
        (lambda lab: (lab / "viewer.key").write_text("x"), r"bus\.tls\.key = .*: holds no private key in PEM"),
        (
            lambda lab: shutil.copy(lab / "rig.key", lab / "viewer.key"),
            r"bus\.tls\.key = .*: does not belong to .*viewer\.pem",
        ),
        (
            lambda lab: expire(lab, "viewer"),
            r"bus\.tls\.certificate = .*viewer\.pem.*: others refuse it, by .*authority\.pem: certificate has expired",
        ),
    ],
)
def test_what_is_wrong_with_a_file_is_said(spoil, message, lab):
    spoil(lab)
    with pytest.raises(TlsError, match=message):
        tls(lab).check("tls/localhost:1", listens=False)


def test_a_certificate_of_another_authority_is_not_used(keys, tmp_path):
    assert cli.main(["keys", str(tmp_path / "other"), "--only", "viewer"]) == 0
    shutil.copy(keys / "authority.pem", tmp_path / "other")
    with pytest.raises(
        TlsError, match=r"bus\.tls\.certificate = .*: others refuse it, by .*: unable to get local issuer"
    ):
        tls(tmp_path / "other").check("tls/localhost:1", listens=False)


@pytest.mark.parametrize(
    ("name", "endpoint", "message"),
    [
        ("rig", "tls/rig.lab:1", "Hostname mismatch, certificate is not valid for 'rig.lab'"),
        ("rig", "tls/127.0.0.1:1", "IP address mismatch, certificate is not valid for '127.0.0.1'"),
        ("viewer", "tls/localhost:1", "unsuitable certificate purpose; a process that listens needs rig.pem"),
    ],
)
def test_who_listens_has_a_certificate_for_its_host(name, endpoint, message, keys):
    with pytest.raises(TlsError, match=message):
        tls(keys, name).check(endpoint, listens=True)


def test_a_name_that_is_no_role_is_refused(lab):
    request, authority = lab / "request", ("-CA", lab / "authority.pem", "-CAkey", lab / "authority.key")
    openssl("req", "-new", "-key", lab / "viewer.key", "-subj", "/CN=guest", "-out", request)
    openssl("x509", "-req", "-in", request, *authority, "-out", lab / "viewer.pem")
    with pytest.raises(TlsError, match='its name is "guest"; this process needs rig or capture or tracker or'):
        tls(lab).check("tls/localhost:1", listens=False)


def test_a_certificate_that_ends_soon_is_warned_of(keys, endpoint, caplog, monkeypatch):
    open_session(encrypted(endpoint), SessionMode.ROUTER, security=tls(keys, "rig")).close()
    assert caplog.text == ""
    monkeypatch.setattr(expiry, "ENDS", timedelta(days=400))
    open_session(encrypted(endpoint), SessionMode.ROUTER, security=tls(keys, "rig")).close()
    assert 'the certificate "rig" ends on 20' in caplog.text


def test_tls_wants_an_endpoint_of_tls(keys):
    with pytest.raises(BusError, match=r'bus\.endpoint = "tcp/localhost:1": must begin with tls/'):
        check_endpoint("tcp/localhost:1", tls(keys))


def test_a_client_that_does_not_trust_the_router_says_so(tmp_path, secured, endpoint, monkeypatch):
    monkeypatch.setattr(session, "CONNECT_TIMEOUT_MS", 500)
    secured("rig", SessionMode.ROUTER)
    assert cli.main(["keys", str(tmp_path / "new"), "--only", "viewer"]) == 0
    message = f'bus.endpoint = "{encrypted(endpoint)}": its certificate is refused here: '
    with pytest.raises(BusError, match=message):
        open_session(encrypted(endpoint), SessionMode.CLIENT, security=tls(tmp_path / "new"))


def test_a_router_that_refuses_a_client_says_why(keys, lab, secured, endpoint):
    """A client that trusts the router, but is of another authority."""
    secured("rig", SessionMode.ROUTER)
    assert cli.main(["keys", str(lab / "new"), "--only", "viewer"]) == 0
    mixed = MutualTls(keys / "authority.pem", lab / "new" / "viewer.pem", lab / "new" / "viewer.key")
    assert mixed.refusal(encrypted(endpoint)).startswith("it refuses this certificate: tls")
    assert tls(keys).refusal("tls/localhost:9") == ""


def test_a_client_without_tls_is_refused(secured, endpoint, monkeypatch):
    monkeypatch.setattr(session, "CONNECT_TIMEOUT_MS", 500)
    secured("rig", SessionMode.ROUTER)
    for address in (endpoint.replace("127.0.0.1", "localhost"), encrypted(endpoint)):
        with pytest.raises(BusError, match=r"TLS is spoken there; give a rig file whose table \[bus\.tls\] .* tls/…"):
            open_session(address, SessionMode.CLIENT)


def test_who_speaks_no_tls_is_not_said_to(open_bus, endpoint, keys):
    open_bus()
    assert NO_SECURITY.refusal(endpoint) == ""
    assert tls(keys).refusal(encrypted(endpoint)).startswith("no TLS is spoken there")


def test_the_end_of_a_certificate_is_told_while_a_process_runs_until_there_is_a_new_one(lab, monkeypatch):
    now_ns, long_ns = 0, expiry.PERIOD_NS
    client = Expiry(tls(lab), "tls/localhost:1", False, lambda: now_ns)
    router = Expiry(tls(lab, "rig"), "tls/localhost:1", True, lambda: now_ns)
    assert client.trouble() == router.trouble() == ""
    monkeypatch.setattr(expiry, "ENDS", timedelta(days=400))
    assert client.trouble().startswith('the certificate "viewer" ends on 20')
    assert router.trouble().startswith('the certificate "rig" ends on 20')
    monkeypatch.setattr(expiry, "ENDS", timedelta(days=30))
    for name in ("viewer", "rig"):
        expire(lab, name)
    now_ns += long_ns
    assert client.trouble().endswith("certificate has expired")  # with which it cannot connect again
    assert router.trouble() == "", "a router goes on with the one that it has read when it started"
    assert cli.main(["keys", str(lab / "new"), "--only", "viewer", "--authority", str(lab)]) == 0
    for file in ("viewer.pem", "viewer.key"):
        shutil.copy(lab / "new" / file, lab / file)
    assert client.trouble() == ""


def test_a_router_says_that_its_new_certificate_waits_for_its_next_start(lab, monkeypatch):
    now_ns = 0
    router = Expiry(tls(lab, "rig"), "tls/localhost:1", True, lambda: now_ns)
    options = ("--only", "rig", "--host", "localhost", "--authority", str(lab), "--days", "700")
    assert cli.main(["keys", str(lab / "new"), *options]) == 0
    for file in ("rig.pem", "rig.key"):
        shutil.copy(lab / "new" / file, lab / file)
    now_ns += expiry.PERIOD_NS
    assert router.trouble() == "", "there is time"
    monkeypatch.setattr(expiry, "ENDS", timedelta(days=400))
    reported = router.trouble()
    assert reported.startswith('the certificate "rig" ends on 20')
    assert reported.endswith("; a new one is in its place, for which this process has to be started again")


def test_a_certificate_that_has_ended_is_told_so():
    yesterday = datetime.now(UTC) - timedelta(days=1)
    assert expiry.warning(Certificate("rig", yesterday)).startswith(
        f'the certificate "rig" has ended on {yesterday:%Y}'
    )
    assert expiry.warning(None) == ""


def test_the_log_says_why_a_router_that_was_lost_cannot_be_reached(tmp_path, keys, endpoint, caplog, monkeypatch):
    monkeypatch.setattr(links, "PATIENCE_S", 1.0)
    assert cli.main(["keys", str(tmp_path / "new"), "--only", "rig", "--host", "localhost"]) == 0
    address = encrypted(endpoint)
    router = open_session(address, SessionMode.ROUTER, security=tls(keys, "rig"))
    with ZenohBus.open("demo", address, SessionMode.CLIENT, security=tls(keys)):
        router.close()
        other = open_session(address, SessionMode.ROUTER, security=tls(tmp_path / "new", "rig"))
        wait_until(lambda: "its certificate is refused here" in caplog.text, 10.0, "the reason")
        other.close()
