"""Requests of the page to the recorder, answered in words."""

import tomllib
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache

from absmsg.v1.command_pb2 import CommandAnswer
from absmsg.v1.health_pb2 import Health
from absmsg.v1.sensor_model_pb2 import Config

from abs_service.bus import keys
from abs_service.display.page.feed import Feed
from abs_service.display.page.readouts.words import STALE_S

#: Asks the recorder to record, or to wait; returns its answer, None if there is none.
Record = Callable[[bool], CommandAnswer | None]

ALWAYS = (
    'Always recording: `record.when = "always"`. With `"requested"` in the rig file, the buttons start and stop it.'
)


def unavailable(feed: Feed) -> str:
    """Reason why recording cannot be started or stopped; "" if it can, or if the configuration is unknown."""
    received = feed.newest(keys.health("record"), Health)
    if received is None or received[1] > 3 * STALE_S:
        return "No recorder runs: there is no recording to start or stop."
    config = feed.newest(keys.CONFIG, Config)
    return ALWAYS if config and _when(config[0].toml) == "always" else ""


def ask(send: Record, recording: bool) -> str:
    """Asks the recorder to record, or to wait, and returns its answer in words."""
    answer = send(recording)
    if answer is None:
        return "The recorder gives no answer. Does it run?"
    if not answer.accepted:
        return f"The recorder refuses: {answer.reason}."
    return "The recorder records." if recording else "The recorder waits for the next trigger."


@lru_cache(maxsize=1)
def _when(toml: str) -> object:
    """The key `record.when` of a rig file; None if it is none, since anybody can publish a configuration."""
    with suppress(tomllib.TOMLDecodeError, AttributeError):
        return tomllib.loads(toml).get("record", {}).get("when", "always")
    return None
