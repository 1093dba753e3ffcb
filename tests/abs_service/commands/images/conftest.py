"""A folder of images that can be imported."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.abs_service.commands.images.importing import CAMERA, COLOR


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three exposures, one of them without colour, and a camera file."""
    for k in range(3):
        cv2.imwrite(str(tmp_path / f"depth_{k:03}.png"), np.full((3, 4), 1000 + k, np.uint16))
        cv2.imwrite(str(tmp_path / f"mask_{k:03}.png"), np.eye(3, 4, dtype=np.uint8))
        if k != 1:
            cv2.imwrite(str(tmp_path / f"color_{k:03}.png"), np.full((3, 4, 3), 40 * k, np.uint8))
    (tmp_path / "camera.toml").write_text(CAMERA + COLOR)
    return tmp_path
