"""Rigs whose routers connect to one of the lab: who is connected there reads them all, and no rig needs it."""

import queue
from contextlib import closing

import pytest

from abs_service.bus.contract import STATE
from abs_service.bus.security.mutual_tls import MutualTls
from abs_service.bus.session import BusError, SessionMode
from abs_service.bus.zenoh_bus import ZenohBus
from abs_service.config import ConfigError, load
from tests.conftest import encrypted
from tests.ports import free_endpoint

ATTEMPTS = 300


@pytest.fixture
def lab():
    return free_endpoint()


@pytest.fixture
def rigs(lab):
    """Routers of two rigs that connect to the lab's, which is not there yet."""
    with (
        ZenohBus.open("left", free_endpoint(), SessionMode.ROUTER, routers=[lab]) as left,
        ZenohBus.open("right", free_endpoint(), SessionMode.ROUTER, routers=[lab]) as right,
    ):
        yield {"left": left, "right": right}


def arrives(sender, receiver):
    """True once a message arrives that is sent again and again."""
    arrived = queue.SimpleQueue()
    with closing(receiver.subscribe("sheet/state", arrived.put)):
        publisher = sender.publisher("sheet/state", "absmsg.v1.DeformationState", STATE)
        for _ in range(ATTEMPTS):
            publisher.put(b"state")
            try:
                return arrived.get(timeout=0.05).payload == b"state"
            except queue.Empty:
                continue
    return False


def test_a_client_of_the_lab_reads_every_rig_also_after_the_labs_router_began_anew(rigs, lab):
    for _ in range(2):
        with ZenohBus.open("lab", lab, SessionMode.ROUTER):
            for name, bus in rigs.items():
                with ZenohBus.open(name, lab, SessionMode.CLIENT) as reader:
                    assert arrives(bus, reader), name


def test_a_rig_works_without_the_labs_router(lab):
    own = free_endpoint()
    with (
        ZenohBus.open("left", own, SessionMode.ROUTER, routers=[lab]) as bus,
        ZenohBus.open("left", own, SessionMode.CLIENT) as near,
    ):
        assert arrives(bus, near)


def test_a_viewer_of_the_lab_reads_a_rig_over_mutual_tls(keys):
    def secured(name):
        return MutualTls(keys / "authority.pem", keys / f"{name}.pem", keys / f"{name}.key")

    lab, own = encrypted(free_endpoint()), encrypted(free_endpoint())
    with (
        ZenohBus.open("lab", lab, SessionMode.ROUTER, security=secured("rig")),
        ZenohBus.open("left", own, SessionMode.ROUTER, security=secured("rig"), routers=[lab]) as bus,
        ZenohBus.open("left", lab, SessionMode.CLIENT, security=secured("viewer")) as reader,
    ):
        assert arrives(bus, reader)


def test_a_malformed_router_is_explained():
    with pytest.raises(BusError, match=r'bus\.routers = "lab:7447": not an endpoint'):
        ZenohBus.open("left", free_endpoint(), SessionMode.ROUTER, routers=["lab:7447"])


def test_with_tls_every_router_has_it(tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text(
        'name = "left"\n[bus]\nendpoint = "tls/a:1"\nrouters = ["tls/b:1", "tcp/c:1"]\n'
        '[bus.tls]\nauthority = "a.pem"\ncertificate = "b.pem"\nkey = "b.key"\n'
    )
    with pytest.raises(ConfigError, match=r"bus\.routers.* = \"tcp/c:1\": must begin with tls/"):
        load(rig)
