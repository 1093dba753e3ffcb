import pytest

from abs_service.bus import keys


@pytest.mark.parametrize(
    "topic",
    [keys.image("tof", "depth"), keys.calibration("tof"), keys.state("sheet"), keys.health("track/sheet"), keys.CONFIG],
)
def test_a_key_gives_its_topic_back(topic):
    key = keys.key("demo", topic)
    assert key == f"abs/demo/{topic}"
    assert keys.topic("demo", key) == topic


@pytest.mark.parametrize("key", ["abs/other/tf", "abs/demo/", "abs/demo", "demo/tf", "abs/demonstration/tf"])
def test_a_key_of_another_rig_is_refused(key):
    with pytest.raises(keys.KeyNameError, match="abs/demo/"):
        keys.topic("demo", key)


@pytest.mark.parametrize("name", ["", "a/b", "a b", "*", "a?", "#", "$x", "-x", "größe", "health", "config", "tf"])
def test_names_that_would_mean_something_in_a_key_are_refused(name):
    with pytest.raises(keys.KeyNameError, match=r"no name|reserved"):
        keys.check_name(name)


def test_the_description_of_an_image_stands_beside_it():
    assert keys.is_image(keys.image("tof", "depth"))
    assert not keys.is_image(keys.calibration("image"))
    assert keys.info(keys.image("image", "depth")) == "image/depth/info"
