"""Threads of a connection: all are waited for when it is closed, whoever began and closes them."""

import json
import os
import resource
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import pytest
from abs_client.connection import shared_memory
from abs_client.connection.link import Link
from abs_client.connection.session import client_settings
from abs_client.errors import UnreachableError

Thread = threading.Thread


class Late(Thread):
    """A thread that needs some time to start, as on a busy machine, and knows who was waited for."""

    joined: ClassVar[list["Late"]] = []

    def start(self):
        time.sleep(0.1)
        super().start()

    def join(self, timeout=None):
        super().join(timeout)
        self.joined.append(self)


def in_two_threads(act):
    both = [Thread(target=act) for _ in range(2)]
    for one in both:
        one.start()
    for one in both:
        one.join()


def test_two_threads_that_subscribe_at_once_are_both_waited_for(bus, endpoint, monkeypatch):
    link = Link(endpoint, "demo")
    monkeypatch.setattr(Late, "joined", [])
    with monkeypatch.context() as patch:
        patch.setattr("abs_client.connection.link.threading.Thread", Late)
        in_two_threads(lambda: link.subscribe("x", print))
    link.close()
    assert len(Late.joined) == 2
    assert not any(one.is_alive() for one in Late.joined)


def test_a_thread_that_begins_while_the_connection_is_closed_does_not_keep_it_from_closing(bus, endpoint, monkeypatch):
    link = Link(endpoint, "demo")
    with monkeypatch.context() as patch:
        patch.setattr("abs_client.connection.link.threading.Thread", Late)
        beginning = Thread(target=link.subscribe, args=("x", print))
        beginning.start()
        time.sleep(0.05)
        link.close()  # it waited for a thread that had not begun, which is an error
        beginning.join()
    assert not [one for one in threading.enumerate() if isinstance(one, Late)]


def test_a_question_that_the_end_of_the_connection_cuts_off_says_so(bus, endpoint):
    asked, enough = threading.Event(), threading.Event()

    def answer():
        asked.set()
        enough.wait(5.0)
        return b""

    bus.answer_queries("slow", "", answer)
    link = Link(endpoint, "demo")
    closing = Thread(target=lambda: asked.wait(5.0) and link.close())
    closing.start()
    with pytest.raises(UnreachableError, match="was closed"):
        link.query("slow")
    enough.set()
    closing.join()


@pytest.mark.parametrize("act", [lambda link: link.query("x"), Link.trackers, lambda link: link.subscribe("x", print)])
def test_what_begins_as_the_connection_ends_is_told_in_words_of_this_package(bus, endpoint, monkeypatch, act):
    link = Link(endpoint, "demo")
    link.close()
    monkeypatch.setattr(Link, "closed", False)  # it was closed by another thread after this one has looked
    with pytest.raises(UnreachableError, match="was closed"):
        act(link)


@pytest.mark.parametrize(
    ("free", "flags", "highest", "used"),
    [
        (9 << 20, 0, resource.RLIM_INFINITY, True),
        (9 << 20, 0, 64 << 20, False),  # the third pool that is mapped would be too much, and its messages lost
        (0, 0, resource.RLIM_INFINITY, False),
        (9 << 20, os.ST_RDONLY, resource.RLIM_INFINITY, False),
    ],
)
def test_shared_memory_is_used_where_there_is_some_and_it_may_be_locked(monkeypatch, free, flags, highest, used):
    monkeypatch.setattr(shared_memory, "PROCESS", Path("/nowhere"))  # without the capability to lock any amount
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (highest, highest))
    monkeypatch.setattr(os, "statvfs", lambda path: SimpleNamespace(f_flag=flags, f_bavail=free, f_frsize=1))
    assert f'"shared_memory": {{"enabled": {str(used).lower()}}}' in json.dumps(client_settings("tcp/host:1"))
