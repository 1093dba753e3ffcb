"""The range of each exposure is known, and none of a time of change is taken for one of either range."""

from drivers.oak.range_profile import SETTLING_NS, RangeProfile

S = 1_000_000_000


def test_exposures_have_the_range_in_force_at_their_time() -> None:
    now_ns = 0
    profile = RangeProfile("mid", lambda: now_ns)
    assert profile.at(5 * S) == "mid"
    now_ns = 10 * S
    profile.change("high")
    profile.change("high")
    assert profile.current == "high"
    times = (0, 10 * S - 1, 10 * S, 10 * S + SETTLING_NS - 1, 10 * S + SETTLING_NS, 20 * S)
    assert [profile.at(t) for t in times] == ["mid", "mid", None, None, "high", "high"]


def test_a_change_before_the_last_one_took_effect_goes_on_with_it() -> None:
    now_ns = 10 * S
    profile = RangeProfile("mid", lambda: now_ns)
    profile.change("high")
    now_ns += SETTLING_NS // 2
    profile.change("low")
    times = (10 * S - 1, 10 * S, now_ns + SETTLING_NS - 1, now_ns + SETTLING_NS)
    assert [profile.at(t) for t in times] == ["mid", None, None, "low"]
