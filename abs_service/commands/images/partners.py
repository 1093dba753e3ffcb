"""Checks that colour images belong to the depth images of a folder."""

from collections.abc import Callable, Sequence

import numpy as np

from drivers.image_folder.listing import ImageFile, ImageFolderError

#: Times of cameras: intervals beyond these [s] are those of another unit.
_INTERVALS_S = (1e-4, 60.0)
#: Difference up to which images belong together where one depth image tells no interval: associate.py of TUM [s].
_ALONE_S = 0.02


def check_numbers(depth: Sequence[ImageFile], color: Sequence[ImageFile], note: Callable[[str], None]) -> None:
    """Notes depth images without a colour image of their number.

    Raises:
        ImageFolderError: all are.
    """
    numbers = {file.seq for file in color}
    without = [file for file in depth if file.seq not in numbers]
    if len(without) == len(depth):
        ranges = (f"{files[0].path.name} to {files[-1].path.name}" for files in (depth, color))
        raise ImageFolderError(
            f"no colour image has the number of a depth image: {' and '.join(ranges)}; the last number in a name has "
            "to count the exposures of both from the same one; times stand in lists (layout tum)"
        )
    if without:
        note(f"{len(without)} of {len(depth)} depth images have no colour image of their number, as {without[0].path}")


def check_times(depth: Sequence[ImageFile], color: Sequence[ImageFile], note: Callable[[str], None]) -> None:
    """Notes depth images without a colour image within half an interval, and intervals that no camera has.

    Raises:
        ImageFolderError: no depth image has a colour image within half an interval.
    """
    times, others = (np.array([file.t_ns for file in files]) for files in (depth, color))
    interval_s = float(np.median(np.diff(times))) * 1e-9 if len(times) > 1 else 2 * _ALONE_S
    if not _INTERVALS_S[0] <= interval_s <= _INTERVALS_S[1]:
        note(f"depth images are {interval_s:.3g} s apart (median): are their times in another unit?")
    after = np.searchsorted(others, times)
    apart = np.minimum(
        np.abs(times - others[np.maximum(after - 1, 0)]), np.abs(times - others[np.minimum(after, len(others) - 1)])
    )
    without = np.flatnonzero(apart * 1e-9 > interval_s / 2)
    if len(without) == len(times):
        raise ImageFolderError(
            f"no colour image is within {interval_s / 2:.3g} s of a depth image: {depth[0].path.name} and "
            f"{color[0].path.name} begin {abs(others[0] - times[0]) * 1e-9:.3g} s apart; are the times of both in one "
            "unit, and of one clock?"
        )
    if len(without):
        which = f"within {interval_s / 2:.3g} s, as {depth[without[0]].path}"
        note(f"{len(without)} of {len(times)} depth images have no colour image {which}")
