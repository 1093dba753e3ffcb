"""Checks of device addresses that need no device."""

from collections.abc import Iterator, Mapping

from abs_service.config.problems import Problem, allowed_instead
from drivers import opening
from drivers.contract.device import AddressError


def check(uris: Mapping[str, str]) -> Iterator[Problem]:
    """The problems of addresses that no device can have. Their drivers are imported, no device is opened.

    Args:
        uris: the addresses by the names of the devices.
    """
    for name, uri in uris.items():
        try:
            opening.check_address(uri)
        except AddressError as error:
            message, scheme = str(error).removeprefix(f"{uri}: "), uri.partition(":")[0]
            if scheme not in (available := opening.available()):
                message = f"no such driver, {allowed_instead(scheme, available)}"
            yield Problem(("devices", name, "uri"), message, uri)
