"""`check` compares a rig file with the images that its devices have."""

import pytest

from abs_service.supervision.exit_codes import Exit
from tests.abs_service.commands.test_check import RIG, checked

__all__ = ["checked"]


def test_a_reference_that_no_tracker_uses_is_refused(checked):
    wrong = 'synchronisation.reference = "tof/dept": tracker "sheet" uses no such images, did you mean "tof/depth"? '
    code, _, err = checked(RIG.replace('"tof/depth"', '"tof/dept"'))
    assert (code, err.count(wrong)) == (Exit.USER, 1)
    own = RIG.replace('sensors = ["tof"]\n', 'sensors = ["tof"]\nreference = "tof/amplitude"\n')
    code, _, err = checked(own)
    assert code == Exit.USER
    assert 'trackers.sheet.reference = "tof/amplitude": tracker "sheet" uses no such images' in err


@pytest.mark.parametrize(
    ("region", "key"),
    [
        ('{ type = "seed", pixel = [5000, 20] }', "pixel = [5000, 20]"),
        ('{ type = "above_plane", seed = [80, 144] }', "seed = [80, 144]"),
        ('{ type = "nearest", polygon = [[180, 20], [300, 20], [200, 90]] }', "polygon = [[180, 20]"),
        ('{ type = "nearest", polygon = [[0, 0], [176, 0], [0, 144]] }', ""),
        ('{ type = "seed", pixel = [175, 143] }', ""),
    ],
)
def test_pixels_outside_a_known_image_are_refused(checked, region, key):
    code, _, err = checked(f"{RIG}region = {region}\n")
    assert code == (Exit.USER if key else Exit.OK)
    if key:
        assert f"trackers.sheet.region.{key}" in err
        assert "lies outside the depth image of tof, which has 176 × 144 pixels" in err


def test_images_of_a_device_that_is_not_open_have_no_rate_yet(checked):
    code, out, _ = checked(RIG.replace("simulated://sheet?seed=1&sensors=tof", "oak://"))
    assert code == Exit.OK
    assert "images: how much is known once the devices are open" in out
