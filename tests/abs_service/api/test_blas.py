"""A program's BLAS has one thread while a frame is computed, and its own number before and after."""

from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import abs_service as a
from abs_service.api.blas import one_blas_thread
from drivers.contract.device import Truth
from drivers.contract.frame import Frame
from drivers.replay import Recording

SAMPLE = Path(__file__).parents[3] / "recordings" / "sample.mcap"


def threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def two_threads() -> Iterator[None]:
    with threadpool_limits(2, user_api="blas"):
        yield


def test_the_last_one_inside_gives_the_threads_back():
    with one_blas_thread:
        with one_blas_thread:
            assert threads() == {1}
        assert threads() == {1}
    assert threads() == {2}


def test_an_error_inside_gives_the_threads_back():
    with pytest.raises(KeyError), one_blas_thread:
        raise KeyError
    assert threads() == {2}


def test_a_frame_is_computed_with_one_thread(monkeypatch: pytest.MonkeyPatch):
    """The reader of the recording looks whenever the tracker asks for an image."""
    seen: list[set[int]] = []

    read = Recording.frames

    def frames(recording: Recording, streams: Collection[tuple[str, str]] = ()) -> Iterator[Frame | Truth]:
        for frame in read(recording, streams):
            seen.append(threads())
            yield frame

    monkeypatch.setattr(Recording, "frames", frames)
    recording = a.open_recording(SAMPLE)
    for _ in islice(recording.rig.tracker().replay(recording), 3):
        assert threads() == {2}
    assert seen
    assert set.union(*seen) == {1}
