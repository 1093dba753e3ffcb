"""Clients whose router is gone ask again soon, whatever has become of the network."""

import json
import socket
from contextlib import closing

import pytest
import zenoh
from abs_client.connection.session import client_settings

from abs_service.bus.session import SessionMode, open_session
from drivers.remote.address import Address
from drivers.remote.link import open_link

#: Longest time between two questions: a try takes 2 s, and another second may pass before the next [s].
PATIENCE_S = 5.0

CLIENTS = {
    "bus": lambda endpoint: open_session(endpoint, SessionMode.CLIENT),
    "remote": lambda endpoint: open_link(Address(port=int(endpoint.rpartition(":")[2]))),
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
