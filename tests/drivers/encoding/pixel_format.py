"""The format of `absmsg/v1/encoded_image.proto`, sample by sample."""

import numpy as np

from drivers.encoding.pixel_filter import Predictor


def encode_plainly(pixels, chosen, mosaic):
    """Content of the Zstandard frame for pixels, the inverse of `decode_plainly`."""
    size = pixels.dtype.itemsize
    image = pixels.view(f"<u{size}").astype(object)  # numbers without a range
    if chosen.green_subtracted:
        image = np.stack([(image[..., c] - (image[..., 1] if c != 1 else 0)) % 256 for c in range(3)], axis=-1)
    joined = b""
    for place in _planes(image, mosaic):
        stored = []
        for (row, column), sample in np.ndenumerate(place):
            difference = (int(sample) - _predicted(place, row, column, chosen.predictor)) % 256**size
            if size > 1:
                signed = difference - 256**size * (2 * difference >= 256**size)
                difference = 2 * signed if signed >= 0 else -2 * signed - 1
            stored.append(difference.to_bytes(size, "big"))
        joined += b"".join(bytes(sample[byte] for sample in stored) for byte in range(size))
    return joined


def decode_plainly(joined, chosen, shape, size, mosaic):
    """Pixels as unsigned integers of `size` bytes, from what the Zstandard frame holds."""
    image = np.zeros(shape, f"<u{size}")
    places = _planes(image, mosaic)
    begin = 0
    for place in places:
        count = place.size
        for number in range(count):
            stored = [joined[begin + byte * count + number] for byte in range(size)]
            difference = int.from_bytes(bytes(stored), "big")
            if size > 1:
                difference = difference // 2 if difference % 2 == 0 else -(difference + 1) // 2
            row, column = np.unravel_index(number, place.shape)
            place[row, column] = (difference + _predicted(place, row, column, chosen.predictor)) % 256**size
        begin += size * count
    if chosen.green_subtracted:
        for channel in (0, 2):
            image[..., channel] += image[..., 1]
    return image


def _planes(image, mosaic):
    """Views of the planes of an image."""
    if mosaic:
        return [image[row::2, column::2] for row in (0, 1) for column in (0, 1)]
    return [image] if image.ndim == 2 else [image[..., channel] for channel in range(image.shape[2])]


def _predicted(plane, row, column, predictor):
    left = int(plane[row, column - 1]) if column else 0
    above = int(plane[row - 1, column]) if row else 0
    corner = int(plane[row - 1, column - 1]) if row and column else 0
    return {
        Predictor.NONE: 0,
        Predictor.LEFT: left,
        Predictor.ABOVE: above,
        Predictor.GRADIENT: left + above - corner,
    }[predictor]
