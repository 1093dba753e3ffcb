"""`abs-service keys` makes certificates that work together, safely, and overwrites nothing."""

import os
import ssl
import stat

import pytest

from abs_service import cli
from abs_service.bus.security import roles
from abs_service.bus.security.mutual_tls import MutualTls


def tls(folder, name):
    return MutualTls(folder / "authority.pem", folder / f"{name}.pem", folder / f"{name}.key")


@pytest.mark.parametrize("umask", [0o000, 0o077])
def test_keys_are_for_their_owner_whatever_the_umask(tmp_path, umask):
    before = os.umask(umask)
    try:
        assert cli.main(["keys", str(tmp_path / "lab"), "--only", "viewer"]) == 0
    finally:
        os.umask(before)
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in (tmp_path / "lab").iterdir()}
    assert modes == {"authority.key": 0o600, "authority.pem": 0o644, "viewer.key": 0o600, "viewer.pem": 0o644}
    assert stat.S_IMODE((tmp_path / "lab").stat().st_mode) == 0o700
    assert [path.name for path in tmp_path.iterdir()] == ["lab"]


def test_there_is_one_for_each_role_and_their_ends_are_said(tmp_path, capsys):
    assert cli.main(["keys", str(tmp_path / "lab"), "--host", "rig.lab", "--host", "10.0.0.7", "--days", "9"]) == 0
    printed = capsys.readouterr().out
    for name in roles.NAMES:
        found = tls(tmp_path / "lab", name).check("", listens=False)
        assert found.name == name
        assert f"{name}.pem, {name}.key: until {found.ends.date()}" in printed
    for endpoint in ("tls/rig.lab:1", "tls/10.0.0.7:1"):
        assert tls(tmp_path / "lab", "rig").check(endpoint, listens=True).name == "rig"


def test_nothing_is_overwritten(tmp_path, capsys):
    assert cli.main(["keys", str(tmp_path / "lab"), "--only", "viewer"]) == 0
    before = {path: path.read_bytes() for path in (tmp_path / "lab").iterdir()}
    assert cli.main(["keys", str(tmp_path / "lab"), "--only", "operator"]) == 2
    assert "exists, and nothing is overwritten" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in (tmp_path / "lab").iterdir()} == before


def test_another_certificate_of_the_same_authority(keys, tmp_path):
    assert cli.main(["keys", str(tmp_path / "bob"), "--only", "viewer", "--authority", str(keys)]) == 0
    assert sorted(path.name for path in (tmp_path / "bob").iterdir()) == ["authority.pem", "viewer.key", "viewer.pem"]
    old = MutualTls(keys / "authority.pem", tmp_path / "bob" / "viewer.pem", tmp_path / "bob" / "viewer.key")
    assert old.check("", listens=False).name == "viewer"


@pytest.mark.parametrize("name", [*roles.NAMES, "authority"])
def test_only_the_authority_signs(keys, name):
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.load_verify_locations(keys / f"{name}.pem")
    assert context.cert_store_stats()["x509_ca"] == (name == "authority")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "--host: give the name of the host that listens"),
        (("--host", "a b"), "--host a b: neither a name nor an IP address"),
        (("--host", "x, DNS:y"), "neither a name nor an IP address"),
        (("--only", "viewer", "--authority", "none"), "none/authority.pem: No such file or directory"),
    ],
)
def test_what_cannot_be_made_is_said_and_leaves_nothing(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["keys", "lab", *arguments]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_file_where_a_folder_should_be_is_named(tmp_path, capsys):
    (tmp_path / "lab").write_text("mine")
    assert cli.main(["keys", str(tmp_path / "lab" / "keys"), "--host", "a"]) == 2
    assert f"{tmp_path}/lab is no folder\n" in capsys.readouterr().err


def test_openssl_that_is_missing_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", "")
    assert cli.main(["keys", str(tmp_path / "lab"), "--only", "viewer"]) == 2
    assert "the program openssl (3.0 or newer)" in capsys.readouterr().err
