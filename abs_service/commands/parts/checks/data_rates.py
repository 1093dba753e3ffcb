"""Bytes per second of a rig's images: on the bus, which for another host is its network, and in a recording."""

from collections.abc import Iterable, Mapping
from typing import Any

from abs_service.config.tables.service import RecordTable
from drivers.contract.capabilities import StreamInfo
from drivers.contract.frame import ENCODINGS
from drivers.encoding.encoded_image import ImageCodec, codec_of

#: Least and greatest share of the bytes that a codec leaves of real and simulated images with noise
#: (docs/decisions/0020, experiment `image_codecs`).
LEFT: Mapping[ImageCodec, tuple[float, float]] = {
    ImageCodec.RAW: (1.0, 1.0),
    ImageCodec.LOSSLESS: (0.1, 0.6),
    ImageCodec.JPEG: (0.04, 0.2),
}


def describe(streams: Mapping[str, Iterable[StreamInfo]], table: RecordTable) -> dict[str, Any]:
    """Rates as plain data, in MB/s.

    Args:
        streams: by sensor; none of a sensor whose device is not open.
        table: settings of the recorder.
    """
    sensors, lowest, highest = {}, 0.0, 0.0
    for sensor, infos in streams.items():
        for info in infos:
            rate = _bytes_per_s(info)
            shares = LEFT[codec_of(info.encoding, ImageCodec(table.depth_codec), ImageCodec(table.color_codec))]
            sensors[sensor] = sensors.get(sensor, 0.0) + rate
            lowest, highest = lowest + shares[0] * rate, highest + shares[1] * rate
    return {
        "sent_mb_s": _megabytes(sum(sensors.values())),
        "sensors_mb_s": {sensor: _megabytes(rate) for sensor, rate in sensors.items()},
        "recorded_mb_s": [_megabytes(lowest), _megabytes(highest)] if table.enabled else [0.0, 0.0],
        "unknown": [sensor for sensor in streams if sensor not in sensors],
    }


def text(rates: Mapping[str, Any]) -> str:
    """The same for people."""
    lowest, highest = rates["recorded_mb_s"]
    written = f"{highest:g}" if lowest == highest else f"{lowest:g} to {highest:g}, by how noisy they are"
    without = f"; without {', '.join(rates['unknown'])}, known once open" if rates["unknown"] else ""
    shares = ", ".join(f"{sensor} {rate:g}" for sensor, rate in rates["sensors_mb_s"].items())
    each = f" ({shares})" if len(rates["sensors_mb_s"]) > 1 else ""
    if rates["unknown"] and not rates["sensors_mb_s"]:
        return "images: how much is known once the devices are open"
    return f"images: {rates['sent_mb_s']:g} MB/s sent{each}, recorded {written}{without}"


def _megabytes(rate: float) -> float:
    return round(1e-6 * rate, 1)


def _bytes_per_s(info: StreamInfo) -> float:
    dtype, channels = ENCODINGS[info.encoding]
    return info.width * info.height * channels * dtype.itemsize * info.rate_hz
