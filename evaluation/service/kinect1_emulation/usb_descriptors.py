"""USB descriptors of an emulated camera (chapter 9 of the USB 2.0 specification)."""

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

#: Endpoints by address and maximum packet size: 960 bytes, twice per microframe.
_PIPES = ((0x81, 0x0BC0), (0x82, 0x0BC0))

#: The alternate settings of a Kinect for Windows' interface: without and with endpoints. Other models have the last
#: only.
INTERFACES = ((), _PIPES)


def device(product: int) -> bytes:
    """Device descriptor."""
    return struct.pack(_LAYOUTS["device"][0], 18, 1, 0x0200, 0, 0, 0, 64, 0x045E, product, 0x010B, 1, 2, 3, 1)


def configuration() -> bytes:
    """Configuration descriptor of an Xbox camera, followed by its interface and endpoint descriptors."""
    parts = interface(0, len(_PIPES)) + b"".join(endpoint(*pipe) for pipe in _PIPES)
    return struct.pack(_LAYOUTS["configuration"][0], 9, 2, 9 + len(parts), 1, 1, 0, 0xC0, 8) + parts


def interface(alternate: int, pipes: int) -> bytes:
    """Interface descriptor of an alternate setting."""
    return struct.pack(_LAYOUTS["interface"][0], 9, 4, 0, alternate, pipes, 255, 255, 255, 0)


def endpoint(address: int, greatest: int) -> bytes:
    """Endpoint descriptor."""
    return struct.pack(_LAYOUTS["endpoint"][0], 7, 5, address, _ISOCHRONOUS, greatest, 1)


def string(text: str) -> bytes:
    """String descriptor."""
    return bytes([2 + 2 * len(text), 3]) + text.encode("utf-16-le")


def fields(kind: str, descriptor: bytes) -> dict[str, int]:
    """Fields of a descriptor by name; `descriptor` may be followed by others."""
    layout, names = _LAYOUTS[kind]
    return dict(zip(names.split(), struct.unpack_from(layout, descriptor)))
