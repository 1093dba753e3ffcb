"""The experiment `image_codecs`: recordings are measured as they are."""

from drivers.encoding.encoded_image import ImageCodec
from evaluation.service import image_codecs
from evaluation.service.image_codecs import images


def test_a_recording_without_loss_is_smaller_than_one_of_raw_images():
    color = images.streams(images.simulated(1, 1))["simulated color/color"]
    raw = image_codecs.record((color,), ImageCodec.RAW, ImageCodec.RAW)
    lossless = image_codecs.record((color,), ImageCodec.LOSSLESS, ImageCodec.LOSSLESS)
    assert 0.42 * raw.size < lossless.size < 0.6 * raw.size  # the noise's entropy, and what a prediction adds
    assert len(lossless.set_s) == 1
