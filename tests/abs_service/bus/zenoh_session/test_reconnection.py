"""Clients whose router is gone ask again soon, whatever has become of the network."""

import json
import socket
from contextlib import closing

import pytest
import zenoh
from abs_client.connection.session import client_settings

from abs_service.bus.session import SessionMode, open_session
from abs_service.bus.zenoh_bus import ZenohBus
from tests.system.running import wait_until

#: Longest time between two questions: a try takes 2 s, and another second may pass before the next [s].
PATIENCE_S = 5.0

CLIENT = SessionMode.CLIENT

CLIENTS = {
    "bus": lambda endpoint: open_session(endpoint, SessionMode.CLIENT),
    "client": lambda endpoint: zenoh.open(zenoh.Config.from_json5(json.dumps(client_settings(endpoint)))),
}


@pytest.mark.parametrize("client", CLIENTS)
def test_a_try_that_gets_no_answer_does_not_keep_from_the_next(client, endpoint):
    router = open_session(endpoint, SessionMode.ROUTER)
    with closing(CLIENTS[client](endpoint)):
        router.close()
        # As a network that is cut: the question is accepted and never answered.
        with socket.create_server(("127.0.0.1", int(endpoint.rpartition(":")[2]))) as silent:
            silent.settimeout(PATIENCE_S)
            first, _ = silent.accept()
            with first, silent.accept()[0] as second:
                assert second.getpeername() != first.getpeername()


def test_the_log_tells_when_a_router_is_gone_and_when_it_is_back(endpoint, caplog):
    with closing(open_session(endpoint, SessionMode.ROUTER)) as router, ZenohBus.open("demo", endpoint, CLIENT):
        router.close()
        wait_until(lambda: f"the connection to {endpoint} is lost" in caplog.text, PATIENCE_S, "a line")
        with closing(open_session(endpoint, SessionMode.ROUTER)):
            wait_until(lambda: f"connected to {endpoint} again" in caplog.text, PATIENCE_S, "another line")
            caplog.clear()
            with ZenohBus.open("demo", endpoint, CLIENT):
                pass
            assert caplog.text == "", "what a process closes itself is no loss"
