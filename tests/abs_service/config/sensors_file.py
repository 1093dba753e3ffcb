"""A small rig file with two sensors."""

from pathlib import Path

from abs_service import config

SENSORS = """
version = 1
name = "bench"

[devices.sim]
uri = "simulated://sheet?seed=1"

[sensors.tof]
device = "sim"
noise = { type = "gaussian_polynomial", sigma = [[0.01]] }

[sensors.color]
device = "sim"
head = "rgb"

[synchronisation]
reference = "tof/depth"
"""


def loads(text: str) -> config.ServiceConfig:
    return config.loads(text, "rig.toml", Path("/rig"))
