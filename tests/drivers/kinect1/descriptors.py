"""What an emulated camera says about itself in USB's own words (chapter 9 of the USB 2.0 specification)."""

import struct

#: The layout of each descriptor, and the names of its fields.
_LAYOUTS = {
    "device": (
        "<BBHBBBBHHHBBBB",
        "bLength bDescriptorType bcdUSB bDeviceClass bDeviceSubClass bDeviceProtocol bMaxPacketSize0 idVendor "
        "idProduct bcdDevice iManufacturer iProduct iSerialNumber bNumConfigurations",
    ),
    "configuration": (
        "<BBHBBBBB",
        "bLength bDescriptorType wTotalLength bNumInterfaces bConfigurationValue iConfiguration bmAttributes bMaxPower",
    ),
    "interface": (
        "<BBBBBBBBB",
        "bLength bDescriptorType bInterfaceNumber bAlternateSetting bNumEndpoints bInterfaceClass bInterfaceSubClass "
        "bInterfaceProtocol iInterface",
    ),
    "endpoint": ("<BBBBHB", "bLength bDescriptorType bEndpointAddress bmAttributes wMaxPacketSize bInterval"),
}

_ISOCHRONOUS = 1

#: Pipes by address and greatest packet: 960 bytes, twice in a microframe.
_PIPES = ((0x81, 0x0BC0), (0x82, 0x0BC0))

#: The alternate settings of a Kinect for Windows' interface: without pipes, and with them. Others have the last only.
INTERFACES = ((), _PIPES)


def device(product: int) -> bytes:
    """Of the whole device."""
    return struct.pack(_LAYOUTS["device"][0], 18, 1, 0x0200, 0, 0, 0, 64, 0x045E, product, 0x010B, 1, 2, 3, 1)


def configuration() -> bytes:
    """Of its only configuration, with the interface and the pipes of a camera for Xbox behind it."""
    parts = interface(0, len(_PIPES)) + b"".join(endpoint(*pipe) for pipe in _PIPES)
    return struct.pack(_LAYOUTS["configuration"][0], 9, 2, 9 + len(parts), 1, 1, 0, 0xC0, 8) + parts


def interface(alternate: int, pipes: int) -> bytes:
    """Of an alternate setting of its only interface."""
    return struct.pack(_LAYOUTS["interface"][0], 9, 4, 0, alternate, pipes, 255, 255, 255, 0)


def endpoint(address: int, greatest: int) -> bytes:
    """Of a pipe."""
    return struct.pack(_LAYOUTS["endpoint"][0], 7, 5, address, _ISOCHRONOUS, greatest, 1)


def string(text: str) -> bytes:
    """Of a text."""
    return bytes([2 + 2 * len(text), 3]) + text.encode("utf-16-le")


def fields(kind: str, descriptor: bytes) -> dict[str, int]:
    """The fields of a descriptor by name; `descriptor` may go on with others."""
    layout, names = _LAYOUTS[kind]
    return dict(zip(names.split(), struct.unpack_from(layout, descriptor)))
