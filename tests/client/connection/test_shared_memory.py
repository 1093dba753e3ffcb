"""The client is a distribution of its own, so it has its own copy of the rule of the service: both say the same."""

import resource

import pytest
from abs_client.connection import shared_memory as of_client

from abs_service.bus.zenoh_session import shared_memory as of_service

MB = 1 << 20


@pytest.mark.parametrize("limit", [0, 64 * MB, 300 * MB, 4000 * MB, resource.RLIM_INFINITY])
@pytest.mark.parametrize("capabilities", [0, 1 << 13, 1 << 14])
@pytest.mark.parametrize("users", ["0 0 4294967295", "0 1000 1"])
@pytest.mark.parametrize("there", [0, 500 * MB])
def test_client_and_service_agree_whether_memory_may_be_locked(
    monkeypatch, tmp_path, limit, capabilities, users, there
):
    (tmp_path / "status").write_text(f"CapEff:\t{capabilities:016x}\n")
    (tmp_path / "uid_map").write_text(users)
    with (tmp_path / "7.zenoh").open("wb") as segment:
        segment.truncate(there)
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (limit, limit))
    monkeypatch.setattr(resource, "setrlimit", lambda kind, limits: None)
    for module in (of_client, of_service):
        monkeypatch.setattr(module, "FOLDER", tmp_path)
        monkeypatch.setattr(module, "PROCESS", tmp_path)
    assert of_client.may_be_locked() == of_service.may_be_locked()
    assert of_client.LOCKED_BYTES == of_service.LOCKED_BYTES
