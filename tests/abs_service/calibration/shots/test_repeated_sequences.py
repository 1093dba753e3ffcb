"""Sequences of one scene count once in a noise calibration, however often they are given."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.calibration.noise import measurement
from abs_service.calibration.noise.repeated import counted_once
from abs_service.calibration.shots import sequences
from calib.noise.base import NoiseError
from tests.calib.sequences.walls import frames

URI = "simulated://wall?sensors=tof&tof=32x24&distance={}&reflectivity={}&seed={}"


def wall(name: str, distance: float = 1.2, reflectivity: float = 0.5, seed: int = 1) -> sequences.Sequence:
    taken, head = frames(URI.format(distance, reflectivity, seed), 0, 20)
    (found,) = sequences.of_frames(name, taken, {"tof": head.camera}, "", 20)
    return found


def test_a_file_that_is_given_three_times_counts_once_and_holds_nothing_out() -> None:
    given = [(wall("a"), 1.2)] * 3
    region = np.ones((24, 32), bool)

    def by_sequence(pairs: list) -> bool:
        taken, targets = [one for one, _ in pairs], [target for _, target in pairs]
        generator = np.random.default_rng(0)
        return measurement.calibrate(taken, targets, region, generator, lambda _: None).by_sequence

    assert by_sequence(given)
    joined, (said,) = counted_once(given)
    assert len(joined) == 1
    assert joined[0][0].lengths.shape == given[0][0].lengths.shape
    assert said == "a, a, a show the same scene, and count as one sequence"
    assert not by_sequence(joined)


def test_two_recordings_of_one_scene_are_joined_with_all_their_frames() -> None:
    both = wall("a")
    parts = [replace(both, name=n, lengths=both.lengths[s], amplitude=both.amplitude[s]) for n, s in HALVES]
    joined, said = counted_once([(part, 1.2) for part in parts])
    assert len(said) == 1
    np.testing.assert_array_equal(joined[0][0].lengths, both.lengths)
    np.testing.assert_array_equal(joined[0][0].amplitude, both.amplitude)


HALVES = (("a", slice(0, 10)), ("b", slice(10, 20)))


@pytest.mark.parametrize("other", [wall("b", distance=1.25), wall("b", reflectivity=0.8)])
def test_other_distances_and_other_materials_are_kept_apart(other: sequences.Sequence) -> None:
    joined, said = counted_once([(wall("a"), 1.2), (other, 1.2)])
    assert len(joined) == 2
    assert said == []


def test_one_scene_cannot_be_at_two_distances() -> None:
    with pytest.raises(NoiseError, match=r"a and b show the same scene, but are said to be 1.2 and 0.8 m away"):
        counted_once([(wall("a"), 1.2), (wall("b"), 0.8)])


def test_images_that_a_camera_repeats_are_left_out_and_counted() -> None:
    once = wall("a")
    twice = replace(once, lengths=once.lengths.repeat(2, axis=0), amplitude=once.amplitude.repeat(2, axis=0))
    ((joined, _),), said = counted_once([(twice, 1.2)])
    np.testing.assert_array_equal(joined.lengths, once.lengths)
    np.testing.assert_array_equal(joined.amplitude, once.amplitude)
    assert said == ["a: 20 of 40 images repeat the one before, and are left out"]


def test_a_camera_that_repeats_one_image_is_refused() -> None:
    once = wall("a")
    stuck = replace(once, lengths=once.lengths[:1].repeat(20, axis=0), amplitude=once.amplitude[:1].repeat(20, axis=0))
    with pytest.raises(NoiseError, match="a: 19 of 20 images repeat the one before, and are left out: fewer than 8"):
        counted_once([(stuck, 1.2)])
