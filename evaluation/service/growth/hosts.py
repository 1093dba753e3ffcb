"""Loads of larger set-ups by the measured costs: extrapolations, nothing here is measured."""

from dataclasses import dataclass

import numpy as np

from abs_service.report.content import Column, Table
from evaluation.service.frame_budget.rig import EXPOSURE_BYTES, RATE_HZ
from evaluation.service.growth.laws import Law

#: Cores of a large host; rigs and hosts of a laboratory.
CORES, RIGS, HOSTS = 64, 10, 3

#: Share of the cores that the service may take, so that other programs and bursts find some.
LOAD = 0.7

#: What an Ethernet of 10 Gbit/s carries [bytes/s].
LINK_BYTES_S = 1.25e9


@dataclass(frozen=True, slots=True)
class Costs:
    """Processor time of an exposure of the rig of today [ms].

    Attributes:
        capture, run, record: of these processes.
        trackers: law of all trackers together, by their number.
    """

    capture: float
    run: float
    record: float
    trackers: Law

    def cores(self, trackers: int) -> float:
        """Cores that a rig with so many trackers takes."""
        return (self.capture + self.run + self.record + self.trackers.time(trackers)) * 1e-3 * RATE_HZ

    def most_trackers(self, cores: float) -> float:
        """Trackers of one rig that so many cores carry."""
        return float(np.floor(self.trackers.wall(cores / RATE_HZ * 1e3 - self.capture - self.run - self.record)))


def table(costs: Costs) -> Table:
    """Extrapolated loads of a large host, and of several rigs on several hosts."""
    usable = LOAD * CORES
    image_bytes_s = EXPOSURE_BYTES * RATE_HZ
    per_host = -(-RIGS // HOSTS)
    rows = (
        (f"rigs with one tracker on {CORES} cores, {LOAD:.0%} of them used", usable // costs.cores(1)),
        (f"trackers of one rig on {CORES} cores, {LOAD:.0%} of them used", costs.most_trackers(usable)),
        (
            f"images that {usable // costs.cores(1):.0f} such rigs record, GB/s",
            usable // costs.cores(1) * image_bytes_s * 1e-9,
        ),
        (f"cores a host, {RIGS} rigs on {HOSTS} hosts, each tracks its own", per_host * costs.cores(1)),
        (f"images that leave a host if all {RIGS} rigs are tracked on one, GB/s", per_host * image_bytes_s * 1e-9),
        ("rigs whose images one link of 10 Gbit/s carries, not compressed", LINK_BYTES_S // image_bytes_s),
    )
    return Table("By the laws, not measured", (Column("what"), Column("number", format=".3g")), rows)
