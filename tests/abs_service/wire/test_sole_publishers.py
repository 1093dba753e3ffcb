"""Two rigs of one name are told from a process that was started again."""

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.wire.sole_publishers import GONE_NS, SolePublishers
from tests.abs_service.bus.loopback import LoopbackBus


def say(bus, boot_id):
    Health(bus, "run", HeaderFactory("bench", WallClock(), boot_id)).publish()


def test_publishers_that_take_turns_are_named_until_one_is_gone():
    bus, now = LoopbackBus(), [0]
    watched = SolePublishers(bus, ["health/run"], lambda: now[0])
    for boot_id in ("ours", "theirs", "third", "ours"):
        assert not watched.trouble
        say(bus, boot_id)
    assert watched.trouble.startswith("several processes publish health/run: another rig has the same name")
    now[0] = GONE_NS
    assert not watched.trouble


def test_a_process_that_is_started_again_is_no_rival():
    bus = LoopbackBus()
    watched = SolePublishers(bus, ["health/run"], lambda: 0)
    for boot in range(20):
        say(bus, str(boot))
        say(bus, str(boot))
    assert not watched.trouble
