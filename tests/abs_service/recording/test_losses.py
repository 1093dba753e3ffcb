"""Drops are told as long as they last, and counted for ever."""

from absmsg.v1.health_pb2 import Health as Message

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.recording.losses import CALM_REPORTS, Losses
from tests.abs_service.bus.loopback import LoopbackBus, health_now


def test_a_disk_that_was_too_slow_once_is_well_again():
    bus = LoopbackBus()
    health = Health(bus, "record", HeaderFactory("demo", WallClock()))
    losses = Losses(health)

    def said(dropped, failed=False):
        losses.report({"tof/depth": dropped}, failed)
        return health_now(health, bus)

    assert said(0).level == Message.LEVEL_OK
    assert said(20, failed=True).level == Message.LEVEL_OK, "RECORD_FAILED says it"
    for _ in range(CALM_REPORTS):
        assert said(25).message == "the disk is too slow: 5 messages dropped"
    calm = said(25)
    assert (calm.level, calm.counters["dropped.tof/depth"]) == (Message.LEVEL_OK, 25)
    assert said(26).message == "the disk is too slow: 6 messages dropped"
