"""Status and staleness in words."""

import math

import pytest

from abs_service.display.page.readouts import words


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.44, "0.4 s"), (19.2, "19 s"), (119.0, "119 s"), (200.0, "3 min"), (7200.0, "120 min")]
)
def test_ages_are_short(seconds, text):
    assert words.age(seconds) == text


def test_a_good_estimate_says_how_good():
    assert words.tracker("TRACKING", [], [], 0.1, 0.77) == words.StatusLine("Tracking, σ 0.77 mm", "", "#16a34a")
    assert words.tracker("TRACKING", [], [], 0.1, math.nan).title == "Tracking"


def test_reasons_warnings_and_the_remedy_are_said():
    said = words.tracker("DEGRADED", ["tof is missing"], ["it fills the image"], 0.1, 2.0)
    assert said.text == "Tof is missing. It fills the image. Use the estimate with care"
    assert "Reinitialise" in words.tracker("LOST", ["hardly any vertex agrees"], [], 0.1, 2.0).text


def test_a_doubt_that_asks_ends_with_its_question_mark():
    said = words.tracker("DEGRADED", ["tof is missing"], ["is the region right?"], 0.1, 2.0)
    assert said.text == "Tof is missing. Is the region right? Use the estimate with care"


def test_a_tracker_that_misses_images_says_that_before_its_other_reasons():
    said = words.tracker("LOST", ["only 46 % agree"], [], 0.1, 2.0, slow="only 7 estimates")
    assert said.text.startswith("Only 7 estimates. Only 46 % agree. Bring")
    good, slow = (words.tracker("TRACKING", [], [], 0.1, 2.0, slow=text) for text in ("", "only 7 estimates"))
    assert (slow.text, slow.color != good.color) == ("Only 7 estimates", True)


def test_an_old_estimate_is_grey_and_says_how_old_whatever_it_said():
    said = words.tracker("TRACKING", [], [], 19.0, 0.77)
    assert said.title == "No estimate for 19 s"
    assert said.color == words.STALE_COLOR
    assert "tracking" in said.text
    assert words.tracker("", [], [], math.inf, math.nan).color == words.STALE_COLOR


def test_a_tracker_that_does_not_keep_up_is_told():
    assert "12 estimates a second of 30 images" in words.slow(12.2, 30.0, 9)
    assert words.slow(29.0, 30.0, 9) == words.slow(5.0, 0.0, 9) == words.slow(1.5, 2.2, 0) == ""


def test_a_silent_rig_is_told_with_what_to_do():
    assert words.silence(0.5, "tcp/rig:1") is None
    said = words.silence(12.0, "tcp/rig:1")
    assert said is not None
    assert said.title == "Nothing received from the rig for 12 s"
    assert "tcp/rig:1" in said.text
    assert "yet" in getattr(words.silence(math.inf, "tcp/rig:1"), "title", "")


def test_an_image_is_titled_by_its_age_or_its_rate():
    assert words.stream("tof/depth", 1.5, 30.0) == "tof/depth, 1.5 s old"
    assert words.stream("tof/depth", 0.5, 30.0) == "tof/depth, 30.0 Hz"
    assert words.stream("tof/depth", 0.5, 0.0) == "tof/depth"  # nobody says, as in a replay
