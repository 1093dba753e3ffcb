"""Files of other programs that were read wrongly without a word."""

from typing import Any

import cv2
import numpy as np

from evaluation.calibration.calibration_cases.case import Bench, Case, Outcome
from evaluation.experiment import at_least, at_most

_K = [[500.0, 0, 320], [0, 501, 240], [0, 0, 1]]
_SIZE = {"image_width": 640, "image_height": 480}


def cases() -> tuple[Case, ...]:
    """Silent failure 4."""
    return (
        Case("4 convert: a skew of 3 px", "dropped without a word", skew),
        Case("4 convert: four coefficients of a fisheye, OpenCV", "read as k1 k2 p1 p2", four_coefficients),
        Case("4 convert: translation in mm", "83 m apart, written", millimetres),
    )


def skew(bench: Bench) -> Outcome:
    """A camera matrix with skew."""
    _stored(bench, K=[[500.0, 3, 320], [0, 501, 240], [0, 0, 1]], **_SIZE)
    return _refused(bench, "skew of 3")


def four_coefficients(bench: Bench) -> Outcome:
    """Four coefficients of whatever lens."""
    _stored(bench, K=_K, D=[[0.1], [-0.02], [0.003], [0.001]], **_SIZE)
    return _refused(bench, "--lens fisheye")


def millimetres(bench: Bench) -> Outcome:
    """A stereo pair 83.2 mm apart, in a file that does not say the unit."""
    _stored(bench, M1=_K, M2=_K, R=np.eye(3).tolist(), T=[[-83.2], [0.5], [1]])
    refused = _refused(bench, "83.21 m apart", "--size", "640x480")
    said = bench.run("calibrate", "convert", "given.yml", "out.toml", "--size", "640x480", "--unit", "mm")
    goals = (*refused.goals, at_least("with --unit mm, 83.2 mm on the terminal", said.count("83.2 mm apart"), 1))
    return Outcome(f"{refused.now}; with --unit mm: {said.line('mm apart')}", goals)


def _refused(bench: Bench, why: str, *options: str) -> Outcome:
    said = bench.run("calibrate", "convert", "given.yml", "out.toml", *options)
    return Outcome(
        f"exit code {said.code}: {said.line(why).removeprefix('abs-service: error: ')}",
        (
            at_least("exit code", said.code, 2, required=True),
            at_most("files written", bench.exists("out.toml"), 0, required=True),
            at_least("reason given", said.count(why), 1),
        ),
    )


def _stored(bench: Bench, **values: Any) -> None:
    """A file of OpenCV."""
    storage = cv2.FileStorage(str(bench.folder / "given.yml"), cv2.FILE_STORAGE_WRITE)
    for key, value in values.items():
        storage.write(key, np.array(value, float) if isinstance(value, list) else value)
    storage.release()
