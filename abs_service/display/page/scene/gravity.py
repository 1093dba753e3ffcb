"""Direction of gravity, from the configuration of a tracker's model."""

import math
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache

from absmsg.v1.sensor_model_pb2 import Config

from abs_service.bus import keys
from abs_service.display.page.feed import Feed

Direction = tuple[float, float, float]


def down(feed: Feed, tracker: str) -> Direction | None:
    """Unit vector of gravity in rig coordinates as the model of a tracker has it; None if it has none."""
    found = feed.newest(keys.CONFIG, Config)
    return _directions(found[0].toml).get(tracker) if found else None


@lru_cache(maxsize=1)
def _directions(toml: str) -> Mapping[str, Direction]:
    """Directions by tracker; invalid ones are left out, since anybody can publish a configuration."""
    found: dict[str, Direction] = {}
    with suppress(tomllib.TOMLDecodeError, AttributeError):
        for name, tracker in tomllib.loads(toml).get("trackers", {}).items():
            with suppress(TypeError, ValueError, KeyError):
                x, y, z = map(float, tracker["model"]["gravity"])
                if 0 < (length := math.hypot(x, y, z)) < math.inf:
                    found[name] = x / length, y / length, z / length
    return found
