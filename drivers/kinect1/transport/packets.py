"""USB packet format: packets with a header; a fixed number of packets is one image.

A packet is `R B 0 flag ? seq ? ? ticks`, the last being 32 bits, and then payload. `flag` is the stream's base with 1
in an image's first packet, 5 in its last and 2 between; `seq` counts the packets of the stream. All numbers are
little-endian.
"""

from dataclasses import dataclass

#: Size of the header, and maximum size of a packet with header: two transactions of a microframe [bytes].
HEADER_BYTES, PACKET_BYTES = 12, 1920

#: Rate of the counter in the headers [1/s]. Its 32 bits wrap every 71.58 s.
TICK_HZ = 60e6


@dataclass(frozen=True)
class PacketFormat:
    """Division of a stream's images into packets.

    Attributes:
        endpoint: address of the isochronous endpoint.
        base: common base of its flags.
        payload: bytes of an image in each packet but the last.
        width, height: of an image [px].
        bits: of a pixel; packed, most significant first.
        rate_hz: images per second.
    """

    endpoint: int
    base: int
    payload: int
    width: int
    height: int
    bits: int
    rate_hz: float = 30.0

    @property
    def image_bytes(self) -> int:
        """Bytes of an image."""
        return self.width * self.height * self.bits // 8

    @property
    def packets(self) -> int:
        """Packets of an image."""
        return -(-self.image_bytes // self.payload)

    def pixels(self, place: int) -> slice:
        """Pixels of an image, row by row, that have a bit in the packet at a place."""
        begin, end = place * self.payload, min((place + 1) * self.payload, self.image_bytes)
        return slice(8 * begin // self.bits, -(-8 * end // self.bits))

    @property
    def period_ticks(self) -> int:
        """Ticks from one image to the next."""
        return round(TICK_HZ / self.rate_hz)


#: Depth takes 7260 of the 8000 microframes per second. Colour and infra-red images share an endpoint.
DEPTH = PacketFormat(0x82, 0x70, 1748, 640, 480, 11)
COLOR = PacketFormat(0x81, 0x80, 1908, 640, 480, 8)
INFRARED = PacketFormat(0x81, 0x80, 1908, 640, 488, 10)
